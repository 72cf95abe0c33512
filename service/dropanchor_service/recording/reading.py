"""Read recordings turn by turn: the messages and the poses. Read a torn file up to the tear."""

from base64 import b64decode
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson
from mcap.records import Channel, Header, Message, Metadata

from dropanchor_schemas.keys import id_from_chunk
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED
from dropanchor_service.recording.mcap_file import METADATA, PROFILE
from dropanchor_service.recording.messages import ESTIMATE, SITE_TOPIC
from dropanchor_service.recording.output import JSON, PACKED
from dropanchor_service.recording.unpacking import READ_ERRORS, TooLargeError, mcap_records
from dropanchor_service.store.anchor_doubts import AnchorDoubt
from dropanchor_service.store.site_values import SiteDocument
from dropanchor_tag_client.recording import RecordingError
from dropanchor_tag_client.recording.order import MAX_DISORDER_S, goes_back
from dropanchor_tag_client.recording.units import LATEST_S

NS_PER_S = 1_000_000_000


@dataclass
class Turn:
    """One turn of the ingest.

    site: the site document if it changed. messages: tag, payload, encoding, UTC of arrival in ns.
    estimates: tag and fields of each recorded pose, without unknown values. doubts: of anchors, if these changed.
    """

    t_ns: int
    site: SiteDocument | None = None
    messages: list[tuple[str, bytes, str, int]] = field(default_factory=list)
    estimates: list[tuple[str, Mapping[str, Any]]] = field(default_factory=list)
    doubts: list[AnchorDoubt] | None = None


class RecordingReader:
    """Reads one file.

    metadata: what the recorder noted in the file, known once `turns` has begun. read_error: why reading stopped
    before the end of the file, else None; known once `turns` has ended.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata: Mapping[str, str] = {}
        self.read_error: str | None = None

    def turns(self) -> Iterator[Turn]:
        """Yield the turns in order. Raises RecordingError when the file is not a recording of this service."""
        topics: dict[int, str] = {}
        turn: Turn | None = None
        number = 0
        for record in self._records():
            if isinstance(record, Metadata) and record.name == METADATA:
                self.metadata = record.metadata
            elif isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                number += 1
                self._check_time(record, f"{self.path} message {number}", turn)
                if turn is None or record.log_time != turn.t_ns:
                    if turn is not None:
                        yield turn
                    turn = Turn(record.log_time)
                try:
                    _add_to(turn, topics.get(record.channel_id, ""), record)
                except ValueError as error:
                    raise RecordingError(f"{self.path}: a message cannot be read: {error}") from error
        if turn is not None:
            yield turn

    def _check_time(self, message: Message, place: str, turn: Turn | None) -> None:
        """Raise RecordingError for a time that no clock of the service shows."""
        if max(message.log_time, message.publish_time) >= LATEST_S * NS_PER_S:
            raise RecordingError(f"{place}: the time is after 2116: the file is damaged")
        back_s = (turn.t_ns - message.log_time) / NS_PER_S if turn is not None else 0.0
        if back_s > MAX_DISORDER_S:
            raise RecordingError(goes_back(place, back_s))

    def _records(self) -> Iterator[Any]:
        records, is_recording = mcap_records(self.path, validate_crcs=True), False
        while True:
            try:
                record = next(records, None)
            except TooLargeError:
                raise
            except READ_ERRORS as error:
                self.read_error = str(error) or type(error).__name__
                record = None
            if isinstance(record, Header):
                is_recording = record.profile == PROFILE
            if not is_recording:
                raise RecordingError(f"{self.path} is not a recording of this service")
            if record is None:
                return
            yield record


def _add_to(turn: Turn, topic: str, message: Message) -> None:
    if topic == SITE_TOPIC:
        turn.site = SiteDocument.model_validate_json(message.data)
    elif topic.startswith("/tag/"):
        chunk, _, leaf = topic.removeprefix("/tag/").partition("/")
        if leaf == JSON:
            turn.messages.append((id_from_chunk(chunk), message.data, ENCODING_JSON, message.publish_time))
        elif leaf == PACKED:
            payload = b64decode(orjson.loads(message.data)["data"])
            turn.messages.append((id_from_chunk(chunk), payload, ENCODING_PACKED, message.publish_time))
        elif leaf == ESTIMATE:
            turn.estimates.append((id_from_chunk(chunk), orjson.loads(message.data)))
