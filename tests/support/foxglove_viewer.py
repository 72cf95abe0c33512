"""A viewer that speaks the Foxglove WebSocket protocol, and reads messages by the advertised schemas."""

import json
import struct
import time
from base64 import b64decode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

SUBPROTOCOL = Subprotocol("foxglove.sdk.v1")
MESSAGE_DATA = 1  # opcode


class Viewer:
    """Subscribes to every topic. messages: of each topic so far, protobuf messages or JSON objects."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._decoders: dict[int, tuple[str, Callable[[bytes], Any]]] = {}
        self.schemas: dict[str, str] = {}
        self.messages: dict[str, list[Any]] = {}

    def receive_until(self, condition: Callable[[], object], timeout_s: float = 30.0) -> None:
        """Take messages until the condition is true."""
        deadline_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline_s, f"not within {timeout_s} s; topics: {self.schemas}"
            self._take(self._connection.recv(timeout=timeout_s))

    def _take(self, message: str | bytes) -> None:
        if isinstance(message, str):
            content = json.loads(message)
            if content["op"] == "advertise":
                self._subscribe(content["channels"])
        elif message[0] == MESSAGE_DATA:
            subscription, _log_time_ns = struct.unpack_from("<IQ", message, 1)
            topic, decode = self._decoders[subscription]
            self.messages.setdefault(topic, []).append(decode(message[13:]))

    def _subscribe(self, channels: list[dict[str, Any]]) -> None:
        for channel in channels:
            self.schemas[channel["topic"]] = channel["schemaName"]
            self._decoders[channel["id"]] = channel["topic"], _decoder(channel)
        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels]
        self._connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


def _decoder(channel: dict[str, Any]) -> Callable[[bytes], Any]:
    if channel["encoding"] == "json":
        return json.loads
    assert channel["encoding"] == channel["schemaEncoding"] == "protobuf"
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(b64decode(channel["schema"])).file:
        pool.Add(file)
    message = GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))
    read: Callable[[bytes], Any] = message.FromString
    return read


@contextmanager
def viewer_at(url: str) -> Iterator[Viewer]:
    """Connect a viewer until the block ends."""
    with connect(url, subprotocols=[SUBPROTOCOL], proxy=None) as connection:
        assert connection.subprotocol == SUBPROTOCOL
        yield Viewer(connection)
