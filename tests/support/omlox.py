"""The omlox interface over stores that the test fills, called without a network or over a WebSocket."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import httpx
from fastapi import FastAPI
from websockets.sync.client import ClientConnection, connect

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.security.identity import Authenticator
from dropanchor_service.store.omlox_items import OmloxItems
from support.api import ApiBench, ask, kind_of, make_api_bench
from support.events import EventBench
from support.http_server import running_server

YARD = Site(
    id="yard",
    anchors=[Anchor(id="17", x=3.0, y=1.0), Anchor(id="18", x=40.0, y=2.0)],
    georeference=Georeference(lat=52.5, lon=13.4, rotation_rad=0.3),
)
BARE = Site(id="yard", anchors=[Anchor(id="17")])


@dataclass
class OmloxBench:
    """A hub over poses, zones and events. folder: where everything is stored, None: nowhere."""

    site: Site = YARD
    folder: Path | None = None
    authenticator: Authenticator | None = None
    rate_limiter: RateLimiter | None = None
    cors_origins: tuple[str, ...] = ()
    poses: ApiBench = field(init=False)

    def __post_init__(self) -> None:
        self.poses = make_api_bench(self.site, self.folder)
        self.start()

    def start(self) -> None:
        """Build the application, again after a restart."""
        self.zones = EventBench(self.folder, poses=self.poses)
        parts = replace(EventParts.in_memory("yard"), items=self.zones.items, store=self.zones.store)
        self.app: FastAPI = self.poses.app(
            events=parts,
            omlox=OmloxItems.opened(self.folder),
            authenticator=self.authenticator,
            rate_limiter=self.rate_limiter,
            cors_origins=self.cors_origins,
        )

    def ask(self, method: str, path: str, version: str = "v2", **options: Any) -> httpx.Response:
        return ask(self.app, method, f"/omlox/{version}/{path}", **options)

    def get(self, path: str, **query: Any) -> Any:
        """Return the JSON of a resource."""
        response = self.ask("GET", path, params=query)
        assert response.status_code == 200, response.text
        return response.json()

    def refusal(self, method: str, path: str, **options: Any) -> tuple[str, int, str]:
        """Return the kind, the code and the message of an error, after a check that it is both kinds of error."""
        response = self.ask(method, path, **options)
        body = response.json()
        assert body["code"] == response.status_code
        assert body["message"] == body["detail"]
        return kind_of(response), body["code"], body["message"]

    def id_of(self, tag: str) -> str:
        """Return the id of the trackable that carries a tag."""
        (trackable,) = self.get(f"providers/{tag}/trackables")
        return str(trackable["id"])

    @contextmanager
    def running(self, protocol: type[GuardedProtocol] = GuardedProtocol) -> Iterator[int]:
        with running_server(self.app, self.poses.stopping, protocol=protocol) as port:
            yield port


@contextmanager
def socket_to(port: int, version: str = "v2", secret: str = "", **options: Any) -> Iterator["Socket"]:
    """Connect to the WebSocket. secret: sent in the header of the handshake."""
    headers = {"authorization": f"Bearer {secret}"} if secret else {}
    url = f"ws://127.0.0.1:{port}/omlox/{version}/ws/socket"
    with connect(url, additional_headers=headers, proxy=None, **options) as connection:
        yield Socket(connection)


@dataclass
class Socket:
    connection: ClientConnection

    def send(self, **message: Any) -> None:
        self.connection.send(json.dumps(message))

    def next(self, timeout_s: float = 20.0) -> Any:
        """Return the next message of the service."""
        return json.loads(self.connection.recv(timeout_s))

    def ask(self, **message: Any) -> Any:
        """Send a message and return the next one of the service."""
        self.send(**message)
        return self.next()

    def subscribe(self, topic: str, **params: Any) -> int:
        """Return the number of a new subscription."""
        answer = self.ask(event="subscribe", topic=topic, params=params)
        assert (answer["event"], answer.get("topic")) == ("subscribed", topic), answer
        return int(answer["subscription_id"])
