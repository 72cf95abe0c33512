"""Reads recordings: turn by turn what came in, and the poses that came out; a torn file as far as it goes."""

import struct
from base64 import b64decode
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson
import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Header, Message, Metadata
from mcap.stream_reader import StreamReader

from dropanchor_schemas.keys import id_from_chunk
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED
from dropanchor_service.recording.mcap_file import METADATA, PROFILE
from dropanchor_service.recording.messages import ESTIMATE, SITE_TOPIC
from dropanchor_service.recording.output import JSON, PACKED
from dropanchor_service.store.site import SiteDocument
from dropanchor_tag_client.recording import RecordingError

_TORN = (McapError, struct.error, zstandard.ZstdError, RuntimeError, ValueError, EOFError)
_RECORD_LIMIT = 2**30


@dataclass
class Turn:
    """One turn of the ingest. site: where it has changed. messages: tag, payload, encoding, arrival.
    estimates: of the poses recorded, by tag; what was not known is not in them."""

    t_ns: int
    site: SiteDocument | None = None
    messages: list[tuple[str, bytes, str, int]] = field(default_factory=list)
    estimates: list[tuple[str, Mapping[str, Any]]] = field(default_factory=list)


class RecordingReader:
    """about: what the recorder wrote of itself; torn: why the file ends before its end, None when it does not. Both
    hold once `turns` has begun, or ended."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.about: Mapping[str, str] = {}
        self.torn: str | None = None

    def turns(self) -> Iterator[Turn]:
        """Raises RecordingError for a file that is no recording of ours."""
        topics: dict[int, str] = {}
        turn: Turn | None = None
        for record in self._records():
            if isinstance(record, Metadata) and record.name == METADATA:
                self.about = record.metadata
            elif isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                if turn is None or record.log_time != turn.t_ns:
                    if turn is not None:
                        yield turn
                    turn = Turn(record.log_time)
                try:
                    _into(turn, topics.get(record.channel_id, ""), record)
                except ValueError as error:
                    raise RecordingError(f"{self.path}: a message cannot be read: {error}") from error
        if turn is not None:
            yield turn

    def _records(self) -> Iterator[Any]:
        with self.path.open("rb") as file:
            records = StreamReader(file, validate_crcs=True, record_size_limit=_RECORD_LIMIT).records
            is_ours = False
            while True:
                try:
                    record = next(records, None)
                except _TORN as error:
                    self.torn = str(error) or type(error).__name__
                    record = None
                if isinstance(record, Header):
                    is_ours = record.profile == PROFILE
                if not is_ours:
                    raise RecordingError(f"{self.path} is not a recording of this service")
                if record is None:
                    return
                yield record


def _into(turn: Turn, topic: str, message: Message) -> None:
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
