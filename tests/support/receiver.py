"""A receiver of webhooks on loopback, in a process of the test."""

import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import orjson

from support.patience import PATIENCE_S


@dataclass
class Receiver:
    """What came, in order of arrival. status: the answer. arrived: all requests, answered or not."""

    port: int = 0
    status: int = 200
    arrived: int = 0
    requests: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    accepted: list[dict[str, Any]] = field(default_factory=list)
    refused_subjects: set[str] = field(default_factory=set)
    release: threading.Event = field(default_factory=threading.Event)
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/events"

    def take(self, headers: dict[str, str], body: bytes) -> int:
        with self.lock:
            self.arrived += 1
        self.release.wait(PATIENCE_S)
        event = orjson.loads(body)
        with self.lock:
            self.requests.append((headers, body))
            status = 400 if event["subject"] in self.refused_subjects else self.status
            if status == 200:
                self.accepted.append(event)
        return status

    def subjects(self) -> list[str]:
        with self.lock:
            return [event["subject"] for event in self.accepted]


@contextmanager
def running_receiver(receiver: Receiver, tls: ssl.SSLContext | None = None) -> Iterator[None]:
    """Serve on the port of the receiver, or on a free one, until the block ends. tls: None serves plain HTTP."""
    receiver.release.set()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            status = receiver.take({name.lower(): value for name, value in self.headers.items()}, body)
            self.send_response(status)
            if status == 302:
                self.send_header("location", "http://127.0.0.1:1/")
            self.send_header("content-length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None: ...

    class Server(ThreadingHTTPServer):
        daemon_threads = True
        request_queue_size = 128

        def handle_error(self, *_: object) -> None: ...  # a killed client

    server = Server(("127.0.0.1", receiver.port), Handler)
    receiver.port = server.server_address[1]
    if tls is not None:
        server.socket = tls.wrap_socket(server.socket, server_side=True)
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()
    try:
        yield
    finally:
        receiver.release.set()
        server.shutdown()
        thread.join()
        server.server_close()
