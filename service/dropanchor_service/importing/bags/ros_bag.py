"""Bags of ROS 1 (.bag) and ROS 2 (a folder, .db3)."""

import struct
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path

import apsw
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag1 import ReaderError as ReaderError1
from rosbags.rosbag2 import ReaderError as ReaderError2
from rosbags.typesys import Stores, TypesysError, get_typestore

from dropanchor_service.importing.bags.bag import NS_PER_S, Message, Topic, normal
from dropanchor_service.importing.readings import ImportingError

_ERRORS = (AnyReaderError, ReaderError1, ReaderError2, TypesysError, apsw.Error, OSError, ValueError, struct.error)
_DAMAGED = (*_ERRORS, AssertionError, KeyError)


class RosBag:
    """A bag. Types that it does not define are those of ROS 2 Humble: later releases write definitions."""

    notes: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        """Raises ImportingError."""
        self._path = path
        with self._opened() as reader:
            seconds = max(0, reader.duration) / NS_PER_S if reader.message_count else 0.0
            counts: Counter[tuple[str, str]] = Counter()
            for connection in reader.connections:
                counts[connection.topic, normal(connection.msgtype)] += connection.msgcount
            known = set(reader.typestore.fielddefs)
        self.topics = [
            Topic(topic, kind, count, seconds, "" if kind in known else "the bag does not define its type")
            for (topic, kind), count in counts.items()
        ]

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Yield the messages of these topics in order of time. Raises ImportingError where the bag is damaged."""
        with self._opened() as reader:
            wanted = [connection for connection in reader.connections if connection.topic in topics]
            stream = reader.messages(wanted) if wanted else iter(())
            while True:
                try:
                    found = next(stream, None)
                except _DAMAGED as error:
                    raise ImportingError(f"{self._path} is damaged: {error}") from error
                if found is None:
                    return
                connection, t_ns, data = found
                try:
                    content = reader.deserialize(data, connection.msgtype)
                except (AnyReaderError, KeyError):
                    content = None
                yield Message(connection.topic, t_ns, content)

    def _opened(self) -> AnyReader:
        try:
            reader = AnyReader([self._path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            reader.open()
            reader.close()
        except _DAMAGED as error:
            raise ImportingError(f"{self._path} cannot be read as a bag of ROS: {error}") from error
        return reader
