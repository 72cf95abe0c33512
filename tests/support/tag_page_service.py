"""The service that the page of a tag talks to: what it receives, and its key."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event

from dropanchor_schemas.wire import ENCODING_PACKED, Frame, decode_packed
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator
from support.api import ApiBench, make_api_bench
from support.http_server import running_server
from support.zenoh_router import free_port


class Service:
    """The interface with the key of the tag anna, at an address that stays. It can be cut and started again."""

    def __init__(self, folder: Path) -> None:
        self.bench: ApiBench = make_api_bench()
        self.bench.answers.now_ns = time.time_ns
        self.keys = ApiKeys(folder)
        self.anna = self.keys.add_for_tag("anna's phone", "anna")
        self.port = free_port()
        self.link = f"http://127.0.0.1:{self.port}/tag#key={self.anna}&tag=anna"

    @contextmanager
    def running(self) -> Iterator[None]:
        self.bench.stopping = Event()
        app = self.bench.app(DASHBOARD, authenticator=Authenticator({SOURCE: self.keys}))
        with running_server(app, self.bench.stopping, self.port):
            yield

    def frames(self) -> list[Frame]:
        """Return what arrived, each message once, in the order of its first arrival."""
        found: dict[tuple[int | None, int | None], Frame] = {}
        for tag, payload, encoding in self.bench.received:
            frame = decode_packed(payload)
            assert (tag, encoding) == ("anna", ENCODING_PACKED)
            assert isinstance(frame, Frame)
            found.setdefault((frame.boot_id, frame.sequence), frame)
        return list(found.values())

    def imu_samples(self) -> int:
        return sum(len(frame.imu) for frame in self.frames())
