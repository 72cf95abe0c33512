"""MCAP files of any writer: messages of ROS 1 and ROS 2, JSON and protobuf. A torn file is read up to the tear."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import orjson
from mcap.reader import SeekingReader
from mcap.records import Channel, Header, Schema
from mcap.records import Message as McapMessage

from dropanchor_service.importing.bags.bag import NS_PER_S, Message, Topic, normal
from dropanchor_service.importing.readings import ImportingError
from dropanchor_service.recording.unpacking import MAX_RECORD, READ_ERRORS, TooLargeError, mcap_records

Decode = Callable[[bytes], Any]


class McapBag:
    """One file. Raises ImportingError when nothing in it can be read."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.notes: list[str] = []
        self.profile = ""
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        counts, seconds = self._summary() or self._counted()
        if not self._channels:
            raise ImportingError("; ".join([f"{path} holds no topic", *self.notes]))
        by_topic: dict[str, Topic] = {}
        for channel in self._channels.values():
            known = by_topic.get(channel.topic)
            count = counts[channel.id] + (known.count if known else 0)
            by_topic[channel.topic] = self._topic(channel, count, seconds)
        self.topics = list(by_topic.values())

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Yield the messages of these topics in the order of the file."""
        decoders = {c.id: self._decoder(c)[0] for c in self._channels.values() if c.topic in topics}
        for record in self._records():
            decode = decoders.get(record.channel_id) if isinstance(record, McapMessage) else None
            if decode is not None:
                yield Message(self._channels[record.channel_id].topic, record.log_time, _decoded(decode, record.data))

    def _summary(self) -> tuple[Counter[int], float] | None:
        """Take the channels from the index at the end of the file; None if it has none."""
        try:
            with self._path.open("rb") as file:
                reader = SeekingReader(file, record_size_limit=MAX_RECORD)
                self.profile = reader.get_header().profile
                summary = reader.get_summary()
        except READ_ERRORS:
            return None
        if summary is None or summary.statistics is None or not summary.channels:
            return None
        self._schemas, self._channels = dict(summary.schemas), dict(summary.channels)
        statistics = summary.statistics
        seconds = (statistics.message_end_time - statistics.message_start_time) / NS_PER_S
        return Counter(statistics.channel_message_counts), seconds

    def _counted(self) -> tuple[Counter[int], float]:
        """Read the whole file, and return its counts."""
        counts: Counter[int] = Counter()
        times: list[int] = []
        for record in self._records():
            if isinstance(record, Header):
                self.profile = record.profile
            elif isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                self._channels[record.id] = record
            elif isinstance(record, McapMessage):
                counts[record.channel_id] += 1
                times = (
                    [min(times[0], record.log_time), max(times[1], record.log_time)] if times else [record.log_time] * 2
                )
        return counts, (times[1] - times[0]) / NS_PER_S if times else 0.0

    def _records(self) -> Iterator[Any]:
        try:
            yield from mcap_records(self._path)
        except TooLargeError:
            raise
        except READ_ERRORS as error:
            self.notes = [
                f"{self._path.name} is cut off or damaged ({error or type(error).__name__}): it is used up to there"
            ]

    def _topic(self, channel: Channel, count: int, seconds: float) -> Topic:
        schema = self._schemas.get(channel.schema_id)
        name = normal(schema.name) if schema else channel.message_encoding
        return Topic(channel.topic, name, count, seconds, self._decoder(channel)[1])

    def _decoder(self, channel: Channel) -> tuple[Decode | None, str]:
        """Return what decodes the messages of a channel, or None and why nothing does."""
        schema, encoding = self._schemas.get(channel.schema_id), channel.message_encoding
        if encoding == "json":
            return orjson.loads, ""
        if schema is None or encoding not in ("cdr", "ros1", "protobuf"):
            return None, f"the encoding {encoding or 'of its messages'} is not known here"
        if encoding == "protobuf":
            from dropanchor_service.importing.bags.protobuf import decoder

            return decoder(schema.name, schema.data)
        from dropanchor_service.importing.bags.ros_types import decoder as ros_decoder

        return ros_decoder(schema.name, schema.encoding, schema.data, encoding)


def _decoded(decode: Decode, data: bytes) -> Any:
    try:
        return decode(data)
    except ValueError:
        return None
