"""The writing side of the recorder: write queued items to one file after the other."""

import logging
import threading
import time
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED
from dropanchor_service.estimation.columns import Array
from dropanchor_service.recording.folder import Limits
from dropanchor_service.recording.mcap_file import McapFile, TooManyChannelsError
from dropanchor_service.recording.messages import pose_messages, site_messages, topic_of
from dropanchor_service.recording.schemas import PACKED_SAMPLES, SAMPLES
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.site_values import SiteDocument
from dropanchor_service.store.tags import TagTable

_log = logging.getLogger(__name__)

PRUNE_S = 10.0
PACKED, JSON = "samples_packed", "samples"  # the last part of a topic, by the encoding of its samples

Messages = Sequence[tuple[int, bytes, str, int]]
"""Row, payload, encoding, UTC of arrival in ns."""


def samples_messages(payload: bytes, encoding: str) -> Iterator[tuple[str, str, bytes]]:
    """Yield the last part of the topic, the schema and the JSON of a message. The decoder rejects other encodings."""
    if encoding.startswith(ENCODING_PACKED):
        yield PACKED, PACKED_SAMPLES, b'{"data":"' + b64encode(payload) + b'"}'
    elif encoding.startswith(ENCODING_JSON):
        yield JSON, SAMPLES, payload


@dataclass(frozen=True)
class Samples:
    """The messages of one turn of the ingest."""

    turn_ns: int
    messages: Messages


@dataclass(frozen=True)
class Poses:
    """The poses that a turn of the ingest produced."""

    turn_ns: int
    poses: Array


@dataclass(frozen=True)
class SiteChange:
    """The site document from this turn on."""

    turn_ns: int
    document: SiteDocument


@dataclass(frozen=True)
class End:
    """The recording was stopped. is_done: set when its last file is finished."""

    is_done: threading.Event = field(default_factory=threading.Event)


Item = Samples | Poses | SiteChange | End


class Output:
    """Writes items to files. Only the writing thread uses it."""

    def __init__(
        self,
        new_file: Callable[[int], McapFile],
        prune: Callable[[str | None], None],
        limits: Limits,
        tags: TagTable,
        site: SiteStore,
    ) -> None:
        """Create an output without a file.

        new_file: creates the file for a turn. prune: deletes old files, but not the file of the given name.
        """
        self._new_file = new_file
        self._prune = prune
        self._limits = limits
        self._tags = tags
        self._site = site
        self._file: McapFile | None = None
        self._document = SiteDocument(site=site.site, tags=site.tags)
        self._topics: dict[tuple[int, str], str] = {}
        self._items_added = 0
        self._pruned_s = 0.0
        self.written = 0
        self.ended_name: str | None = None  # the last file of the last recording that was stopped
        self._is_omitting = False  # messages, because the open file has no room for their topics

    @property
    def open_name(self) -> str | None:
        file = self._file
        return None if file is None else file.path.name

    def write(self, items: Sequence[Item]) -> None:
        """Write the items.

        Raises OSError, and may then be called again with the same items and more: no item is written twice.
        """
        if self._file is not None and self._is_full(self._file):
            self._finish()
        try:
            for item in items[self._items_added :]:
                self._add(item)
                self._items_added += 1
            if self._file is not None:
                self._file.flush()
        except OSError:
            raise
        except Exception:  # a bug: the caller does not repeat these items
            self._items_added = 0
            raise
        self._items_added = 0
        if time.monotonic() - self._pruned_s > PRUNE_S:
            self._pruned_s = time.monotonic()
            self._prune(self.open_name)

    def _add(self, item: Item) -> None:
        match item:
            case End(is_done):
                self.ended_name = self.open_name
                self._finish()
                is_done.set()
            case SiteChange(turn_ns, document):
                self._document = document
                if self._file is not None:
                    self._add_site(self._file, turn_ns)
            case Samples(turn_ns, messages):
                self._add_samples(self._file_at(turn_ns), turn_ns, messages)
            case Poses(turn_ns, poses):
                self._add_poses(self._file_at(turn_ns), turn_ns, poses)

    def _file_at(self, turn_ns: int) -> McapFile:
        if self._file is None:
            self._file, self._is_omitting = self._new_file(turn_ns), False
            self._add_site(self._file, turn_ns)
        return self._file

    def _is_full(self, file: McapFile) -> bool:
        return file.size > self._limits.file_bytes or time.monotonic_ns() - file.opened_ns > self._limits.file_ns

    def _finish(self) -> None:
        if self._file is not None:
            self._file.finish()
            self._file = None

    def _add_site(self, file: McapFile, turn_ns: int) -> None:
        for topic, schema, message in site_messages(self._document, turn_ns):
            file.add(topic, schema, turn_ns, turn_ns, message)

    def _add_samples(self, file: McapFile, turn_ns: int, messages: Messages) -> None:
        for row, payload, encoding, arrival_ns in messages:
            try:
                for leaf, schema, message in samples_messages(payload, encoding):
                    file.add(self._topic(row, leaf), schema, turn_ns, arrival_ns, message)
                self.written += 1
            except TooManyChannelsError:
                self._omit(file)

    def _omit(self, file: McapFile) -> None:
        if not self._is_omitting:
            self._is_omitting = True
            _log.warning("%s has no room for more tags; they are recorded again in the next file", file.path.name)

    def _topic(self, row: int, leaf: str) -> str:
        topic = self._topics.get((row, leaf))
        if topic is None:
            topic = self._topics[row, leaf] = topic_of(self._tags.rows.at(row).name, leaf)
        return topic

    def _add_poses(self, file: McapFile, turn_ns: int, poses: Array) -> None:
        anchors = [anchor.id for anchor in self._site.anchors_by_index()]
        for pose in poses:
            index = int(pose["anchor"])
            anchor = anchors[index] if 0 <= index < len(anchors) else None
            try:
                for topic, schema, message in pose_messages(
                    pose, self._tags.rows.at(pose["row"]).name, anchor, self._document
                ):
                    file.add(topic, schema, turn_ns, int(pose["t_ns"]), message)
                self.written += 1
            except TooManyChannelsError:
                self._omit(file)
