"""What a tag sent in some minutes, as a recording that `dropanchor replay` runs, or as a table."""

import csv
import io
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import TagSettings
from dropanchor_service.blackbox.chosen import BoxError, chosen, turns_of
from dropanchor_service.blackbox.pieces import pieces_in
from dropanchor_service.checkpoints.format import CheckpointError
from dropanchor_service.estimation.columns import Array
from dropanchor_service.ingest.decode import decode
from dropanchor_service.recording.mcap_file import SESSION, McapBytes
from dropanchor_service.recording.messages import site_messages, topic_of
from dropanchor_service.recording.output import samples_messages
from dropanchor_service.recording.reading import Turn
from dropanchor_service.store.site_values import SiteDocument

CHUNK_TURNS = 600
NOBODY, NOWHERE = "tag-1", "site-1"
COLUMNS = (
    *("t_ns", "arrival_ns", "kind", "anchor", "value", "std"),
    *(f"{name}_{axis}" for name in ("acc", "gyro", "mag") for axis in "xyz"),
)


class Sent:
    """What a tag sent in a period, and the site then. Creating it raises BoxError.

    anonymous: without the names of tags and of the site, of which only this tag and the anchors are left.
    """

    def __init__(self, folder: Path, site: str, tag: str, from_ns: int, to_ns: int, anonymous: bool) -> None:
        oldest = next(iter(pieces_in(folder)), None)
        if oldest is not None and oldest.from_ns <= to_ns:
            from_ns = max(from_ns, oldest.from_ns)  # what is left of the period
        pieces = chosen(folder, from_ns, to_ns, lead_ns=0)
        try:
            head = pieces[0].head()
        except (OSError, CheckpointError) as error:
            raise BoxError(str(error)) from error
        self._tag, self._anonymous = tag, anonymous
        self.name = NOBODY if anonymous else tag
        self._metadata = {**head.metadata, SESSION: str(from_ns)}
        self._document = head.documents[site]
        turns = turns_of(pieces, site, {tag}, pieces[0].from_ns, to_ns)
        self._turns = self._from(turns, from_ns)
        self._first = next(self._turns, None)
        if self._first is None:
            raise BoxError(say("box_nothing_sent", "Tag {tag} sent nothing then.", tag=repr(tag)))

    def _from(self, turns: Iterable[Turn], from_ns: int) -> Iterator[Turn]:
        """Yield the turns with messages from a time on. The settings of before are those of the first."""
        for turn in turns:
            if turn.t_ns < from_ns or not turn.messages:
                self._document = turn.site or self._document
            else:
                yield turn

    def _all(self) -> Iterator[list[Turn]]:
        some = [] if self._first is None else [self._first]
        for turn in self._turns:
            some.append(turn)
            if len(some) == CHUNK_TURNS:
                yield some
                some = []
        yield some

    def mcap(self) -> Iterator[bytes]:
        """Yield the bytes of a recording."""
        file, document = McapBytes(self._metadata), None
        for turns in self._all():
            for turn in turns:
                self._document = turn.site or self._document
                if document is not self._document:
                    document = self._document
                    for topic, schema, message in site_messages(self._shown(document), turn.t_ns):
                        file.add(topic, schema, turn.t_ns, turn.t_ns, message)
                for _, payload, encoding, arrival_ns in turn.messages:
                    for leaf, schema, message in samples_messages(payload, encoding):
                        file.add(topic_of(self.name, leaf), schema, turn.t_ns, arrival_ns, message)
            yield file.taken()
        yield file.end()

    def _shown(self, document: SiteDocument) -> SiteDocument:
        """Return the site with the settings of this tag alone."""
        settings = document.tags.get(self._tag)
        if not self._anonymous:
            return SiteDocument(site=document.site, tags={} if settings is None else {self._tag: settings})
        labels = {"name": "", "group": "", "colour": None}
        bare = {} if settings is None else {NOBODY: TagSettings.model_validate(settings.model_dump() | labels)}
        site = document.site.model_copy(update={"id": NOWHERE, "name": "", "georeference": None})
        return SiteDocument(site=site, tags=bare)

    def table(self) -> Iterator[bytes]:
        """Yield the lines of a table: one for each sample, in the order of arrival."""
        yield _lines([COLUMNS])
        for turns in self._all():
            messages = [message for turn in turns for message in turn.messages]
            if messages:
                _, payloads, encodings, arrivals = zip(*messages, strict=True)
                yield _lines(_rows(payloads, encodings, arrivals))


def _rows(payloads: tuple[bytes, ...], encodings: tuple[str, ...], arrivals: tuple[int, ...]) -> Iterator[list[Any]]:
    decoded = decode(payloads, encodings)
    found: list[tuple[int, list[Any]]] = []
    for kind, column in zip(KINDS, decoded.columns(), strict=True):
        for sample in column:
            message = int(sample["message"])
            line = [int(sample["t_ns"]), arrivals[message], kind.name]
            found.append((message, line + (_imu(sample) if kind is KINDS[0] else _scalar(sample, kind.has_anchor))))
    yield from (line for _, line in sorted(found, key=lambda one: one[0]))


def _imu(sample: Array) -> list[Any]:
    return ["", "", "", *_known(np.concatenate([sample[name] for name in ("acc", "gyro", "mag")]))]


def _scalar(sample: Array, has_anchor: bool) -> list[Any]:
    return [int(sample["anchor"]) if has_anchor else "", *_known(np.array([sample["value"], sample["std"]]))]


def _known(values: Array) -> list[Any]:
    return ["" if np.isnan(value) else value for value in values.tolist()]


def _lines(rows: Iterable[Iterable[Any]]) -> bytes:
    text = io.StringIO(newline="")
    csv.writer(text).writerows(rows)
    return text.getvalue().encode()
