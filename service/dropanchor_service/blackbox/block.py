"""The bytes of some turns of the ingest: columns, of which each packs better than the messages one by one.

Payloads of one size lie under each other, and are written byte by byte down the columns: the same byte of the same
field of many samples stands together then. A digest detects damage.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED
from dropanchor_service.checkpoints.format import sealed, unsealed
from dropanchor_service.estimation.columns import Array
from dropanchor_service.recording.reading import Turn
from dropanchor_service.store.anchor_doubts import AnchorDoubt
from dropanchor_service.store.site_values import SiteDocument

LEVEL = 3  # of Zstandard: level 1 leaves 6 % more, and higher ones save 1 %
_COLUMNS: dict[str, str] = {"turns": "<i8", "counts": "<u4", "rows": "<i4", "arrivals": "<i8", "sizes": "<u4"}
_IS_PACKED = "<u1"

Messages = Sequence[tuple[int, bytes, str, int]]
"""Row, payload, encoding, UTC of arrival in ns."""
TagKey = tuple[str, str]
"""Site and tag."""
Doubts = Sequence[tuple[str, tuple[Any, ...]]]
"""Site, and the fields of the `AnchorDoubt` of an anchor there."""


@dataclass(frozen=True)
class BoxTurn:
    """A turn of the ingest. documents: of the sites that changed before it, by their ids. doubts: if these changed."""

    turn_ns: int
    messages: Messages = ()
    documents: Mapping[str, SiteDocument] = field(default_factory=dict)
    doubts: Doubts | None = None


def encoded_turns(turns: Sequence[BoxTurn], tags: Mapping[int, TagKey]) -> list[bytes]:
    """Return the bytes of turns, in parts. tags: site and tag of each row."""
    every = [message for turn in turns for message in turn.messages if _is_kept(message[2])]
    rows, payloads, encodings, arrivals = zip(*every, strict=True) if every else ((), (), (), ())
    columns = {
        "turns": [turn.turn_ns for turn in turns],
        "counts": [sum(_is_kept(message[2]) for message in turn.messages) for turn in turns],
        "rows": rows,
        "arrivals": arrivals,
        "sizes": [*map(len, payloads)],
    }
    arrays = {name: np.array(values, _COLUMNS[name]) for name, values in columns.items()}
    header = {
        "tags": [(row, *tags[row]) for row in dict.fromkeys(rows)],
        "documents": [
            (index, site, document.model_dump(mode="json"))
            for index, turn in enumerate(turns)
            for site, document in turn.documents.items()
        ],
        "doubts": [(index, turn.doubts) for index, turn in enumerate(turns) if turn.doubts is not None],
        "lengths": [len(turns), len(every)],
    }
    packed = np.array([encoding.startswith(ENCODING_PACKED) for encoding in encodings], _IS_PACKED)
    whole = np.frombuffer(b"".join(payloads), np.uint8)
    return sealed(header, [*arrays.values(), packed, *_down(whole, arrays["sizes"], arrays["rows"])], LEVEL)


def doubts_of(site: str, doubts: Doubts) -> list[AnchorDoubt]:
    """Return the doubts of one site."""
    return [AnchorDoubt(*doubt) for of, doubt in doubts if of == site]


def _is_kept(encoding: str) -> bool:
    return encoding.startswith((ENCODING_PACKED, ENCODING_JSON))  # the decoder rejected any other


def _down(whole: Array, sizes: Array, rows: Array) -> Iterator[Array]:
    """Yield the payloads of each size as the columns of their bytes. Those of a tag are neighbours."""
    begins = np.cumsum(sizes, dtype=np.int64) - sizes
    for size, places in _groups(sizes, rows):
        taken = begins[places, None] + np.arange(size)
        yield np.ascontiguousarray(whole[taken].T)


def _groups(sizes: Array, rows: Array) -> Iterator[tuple[int, Array]]:
    """Yield each size, and the places of the messages that have it, by their rows."""
    order = np.lexsort((rows, sizes))
    _, firsts = np.unique(sizes[order], return_index=True)
    for places in np.split(order, firsts[1:]) if len(order) else ():
        yield int(sizes[places[0]]), places


class Block:
    """The turns in some bytes. Creating it raises CheckpointError if they are damaged."""

    def __init__(self, whole: bytes) -> None:
        header, content = unsealed(whole)
        self._tags: dict[int, TagKey] = {row: (site, tag) for row, site, tag in header["tags"]}
        self._documents: list[tuple[int, str, Any]] = header["documents"]
        self._doubts: dict[int, Doubts] = dict(header.get("doubts", ()))
        turns, messages = header["lengths"]
        parts = {name: turns if name in ("turns", "counts") else messages for name in _COLUMNS}
        self._columns: dict[str, Array] = {}
        begin = 0
        for name, kind, length in [*((n, _COLUMNS[n], parts[n]) for n in parts), ("packed", _IS_PACKED, messages)]:
            end = begin + length * np.dtype(kind).itemsize
            self._columns[name] = np.frombuffer(content[begin:end], kind)
            begin = end
        self._payloads = np.frombuffer(content[begin:], np.uint8)

    def turns(self, site: str, tags: Set[str] | None = None) -> Iterator[Turn]:
        """Yield the turns in which these tags of a site sent something, or what is known of the site changed.

        tags: None for all.
        """
        columns = self._columns
        wanted = {row: tag for row, (of, tag) in self._tags.items() if of == site and (tags is None or tag in tags)}
        payloads = self._payloads_of(np.isin(columns["rows"], list(wanted)))
        documents = {index: document for index, of, document in self._documents if of == site}
        in_turn = np.repeat(np.arange(len(columns["turns"])), columns["counts"])
        found: dict[int, Turn] = {index: Turn(int(columns["turns"][index])) for index in {*documents, *self._doubts}}
        for index, document in documents.items():
            found[index].site = SiteDocument.model_validate(document)
        for index, doubts in self._doubts.items():
            found[index].doubts = doubts_of(site, doubts)
        for place in sorted(payloads):
            index = int(in_turn[place])
            turn = found.setdefault(index, Turn(int(columns["turns"][index])))
            encoding = ENCODING_PACKED if columns["packed"][place] else ENCODING_JSON
            tag, arrival_ns = wanted[int(columns["rows"][place])], int(columns["arrivals"][place])
            turn.messages.append((tag, payloads[place], encoding, arrival_ns))
        yield from (found[index] for index in sorted(found))

    def _payloads_of(self, wanted: Array) -> dict[int, bytes]:
        """Return the payload of each message of which `wanted` is true, by its place."""
        found, begin = dict[int, bytes](), 0
        for size, places in _groups(self._columns["sizes"], self._columns["rows"]):
            columns = self._payloads[begin : begin + size * len(places)].reshape(size, len(places))
            begin += columns.size
            own = np.flatnonzero(wanted[places])
            payloads = np.ascontiguousarray(columns[:, own].T)
            found |= {int(places[k]): payload.tobytes() for k, payload in zip(own.tolist(), payloads, strict=True)}
        return found
