"""Bags of ROS 1 (.bag) and ROS 2 (a folder, .db3)."""

import struct
from collections import Counter
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path

import apsw
import zstandard
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import ReaderError as ReaderError1
from rosbags.rosbag1.reader import decompressors
from rosbags.rosbag2 import ReaderError as ReaderError2
from rosbags.typesys import Stores, TypesysError, get_typestore

from dropanchor_service.importing.bags.bag import NS_PER_S, Message, Topic, normal
from dropanchor_service.importing.readings import ImportingError
from dropanchor_service.recording.unpacking import TooLargeError, mcap_records, unpacked
from dropanchor_tag_client.recording.bounded import Bounded

_ERRORS = (AnyReaderError, ReaderError1, ReaderError2, TypesysError, apsw.Error, OSError, ValueError, struct.error)
_DAMAGED = (*_ERRORS, AssertionError, KeyError)


class RosBag:
    """A bag. Types that it does not define are those of ROS 2 Humble: later releases write definitions."""

    notes: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        """Raises ImportingError."""
        self._path = path
        _check_files(path)
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
            is_packed = _set_limits(reader, self._path)
            wanted = [connection for connection in reader.connections if connection.topic in topics]
            stream = reader.messages(wanted) if wanted else iter(())
            while True:
                try:
                    found = next(stream, None)
                except TooLargeError:
                    raise
                except _DAMAGED as error:
                    raise ImportingError(f"{self._path} is damaged: {error}") from error
                if found is None:
                    return
                connection, t_ns, data = found
                if is_packed:
                    data = unpacked("zstd", data, f"{self._path}: a message of {connection.topic}")
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


def _check_files(path: Path) -> None:
    """Raise RecordingError for a file of a bag that the library would unpack without a limit."""
    for file in sorted(path.iterdir()) if path.is_dir() else ():
        if file.suffix == ".mcap":
            for _ in mcap_records(file):
                pass
        elif file.suffix == ".zstd":
            with zstandard.open(file) as source:
                inner = Bounded(source, file, file.stat().st_size)
                while inner.read(2**20):
                    pass


def _set_limits(reader: AnyReader, path: Path) -> bool:
    """Let the library unpack chunks of ROS 1 with a limit. Return whether messages are packed, and remain so."""
    names = {function: name for name, function in decompressors.items()}
    is_packed = False
    for bag in reader.readers:
        if isinstance(bag, Reader1):
            bag.chunks = {
                at: chunk._replace(
                    decompressor=partial(unpacked, names[chunk.decompressor], what=f"{path}: chunk {number}")
                )
                for number, (at, chunk) in enumerate(sorted(bag.chunks.items()), 1)
            }
        elif bag.compression_mode == "message":
            bag.storage.metadata = bag.storage.metadata._replace(compression_mode=None)
            is_packed = True
    return is_packed
