"""A TCP relay in this process that can fall silent, as a network does that a phone walks out of."""

import select
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

_CHUNK = 65_536


class Relay:
    """port: where it listens. silent: while set, nothing that arrives is passed on, and nobody is told.

    from_clients: number of bytes that the clients sent so far.
    """

    def __init__(self, target: int) -> None:
        self.silent = Event()
        self.from_clients = 0
        self._target = target
        self._stop = Event()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        self._peers: dict[socket.socket, socket.socket] = {}
        self._clients: set[socket.socket] = set()
        self._deaf: list[socket.socket] = []

    def run(self) -> None:
        while not self._stop.is_set():
            for ready in select.select([self._listening, *self._peers], [], [], 0.05)[0]:
                if ready is self._listening:
                    self._accept()
                elif ready in self._peers:
                    self._pass_on(ready)
        for each in (self._listening, *self._peers, *self._deaf):
            each.close()

    def stop(self) -> None:
        self._stop.set()

    def _accept(self) -> None:
        client, _ = self._listening.accept()
        server = socket.create_connection(("127.0.0.1", self._target))
        self._peers |= {client: server, server: client}
        self._clients.add(client)

    def _pass_on(self, source: socket.socket) -> None:
        try:
            data = source.recv(_CHUNK)
            self.from_clients += len(data) if source in self._clients else 0
            if data and not self.silent.is_set():
                self._peers[source].sendall(data)
        except OSError:
            data = b""
        if not data:
            self._ended(source)

    def _ended(self, source: socket.socket) -> None:
        """Close the other side too, which does not hear of it while this is silent."""
        peer = self._peers.pop(source)
        self._clients -= {source, peer}
        source.close()
        if self._peers.pop(peer, None) is None:
            return
        if self.silent.is_set():
            self._deaf.append(peer)
        else:
            peer.close()


@contextmanager
def running_relay(target: int) -> Iterator[Relay]:
    """Relay connections to a port of the loopback until the block ends."""
    relay = Relay(target)
    thread = Thread(target=relay.run)
    thread.start()
    try:
        yield relay
    finally:
        relay.stop()
        thread.join()
