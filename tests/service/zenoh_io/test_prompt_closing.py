"""A router does not linger over a connection whose other end has vanished."""

import os
import socket
import stat
import struct
from collections.abc import Iterator
from contextlib import suppress

from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io.session import open_session
from support.zenoh_router import connected_session, free_endpoint, wait_until


def lingering(port: int) -> Iterator[bool]:
    """Yield whether each connection that this process accepted at the port lingers when it is closed."""
    for file in map(int, os.listdir("/dev/fd")):
        with suppress(OSError):
            if not stat.S_ISSOCK(os.fstat(file).st_mode):
                continue
            with socket.socket(fileno=os.dup(file)) as connection:
                address = connection.getsockname()
                listens = connection.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
                option = connection.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.calcsize("ii"))
            if address[1:2] == (port,) and not listens:
                yield bool(struct.unpack("ii", option)[0])


def test_connections_that_come_one_after_another_do_not_linger() -> None:
    endpoint = free_endpoint()
    port = int(endpoint.rpartition(":")[2])
    with open_session(ZenohSettings(listen=(endpoint,))), connected_session(endpoint):
        wait_until(lambda: [*lingering(port)] == [False])
        with connected_session(endpoint):
            wait_until(lambda: [*lingering(port)] == [False, False])
