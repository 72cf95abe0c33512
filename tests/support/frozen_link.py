"""A TCP link that can be frozen: both ends stay connected, and nothing comes through any more."""

import select
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from threading import Event, Thread

from support.zenoh_router import free_port


class FrozenLink:
    """endpoint: where to connect instead of the target. frozen: set it to stop forwarding."""

    def __init__(self, target_port: int) -> None:
        self.frozen = Event()
        self._target_port = target_port
        self._stop = Event()
        port = free_port()
        self.endpoint = f"tcp/127.0.0.1:{port}"
        self._listener = socket.create_server(("127.0.0.1", port))
        self._listener.settimeout(0.1)
        self._threads = [Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def close(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()
        self._listener.close()

    def _accept(self) -> None:
        while not self._stop.is_set():
            with suppress(TimeoutError):
                client, _ = self._listener.accept()
                thread = Thread(target=self._forward, args=(client,), daemon=True)
                self._threads.append(thread)
                thread.start()

    def _forward(self, client: socket.socket) -> None:
        with ExitStack() as stack:
            stack.enter_context(client)
            if self.frozen.is_set():  # a newcomer does not reach the target either
                self._stop.wait()
                return
            target = stack.enter_context(socket.create_connection(("127.0.0.1", self._target_port)))
            while not self._stop.is_set():
                if self.frozen.is_set():
                    self._stop.wait(0.1)
                    continue
                for readable in select.select([client, target], [], [], 0.1)[0]:
                    data = readable.recv(65_536)
                    if not data:
                        return
                    (target if readable is client else client).sendall(data)


@contextmanager
def frozen_link(target_endpoint: str) -> Iterator[FrozenLink]:
    """Run a link to an endpoint on loopback until the block ends."""
    link = FrozenLink(int(target_endpoint.rpartition(":")[2]))
    try:
        yield link
    finally:
        link.close()
