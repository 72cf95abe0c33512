"""The wiring of an API node."""

import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from contextlib import ExitStack, asynccontextmanager, suppress
from threading import Event
from typing import Self

from fastapi import FastAPI

from dropanchor_service.api.http.borders import border_of
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.http.server import build_server, listen
from dropanchor_service.api.http.thread import HttpThread
from dropanchor_service.metrics.node import LeaseGauges, NodeMetrics
from dropanchor_service.node.app import create_node_app
from dropanchor_service.node.forwarding import Forwarding
from dropanchor_service.node.gateway import Gateway
from dropanchor_service.node.leases_seen import LeasesSeen
from dropanchor_service.node.links import Links, trusted
from dropanchor_service.node.owners import Owners
from dropanchor_service.node.sockets import Sockets
from dropanchor_service.security.credentials import certificate_of, credentials_of, keys_and_tokens_of
from dropanchor_service.security.node_secret import node_secret_of
from dropanchor_service.settings.http_url import http_url
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io.exposure import refuse_exposure

HTTP_STOP_S = 1.5

_log = logging.getLogger(__name__)


class Node:
    """A running node: `with Node(settings) as node`. Creating or entering it raises SettingsError or ListenError.

    url: the address of the page and the REST interface, known once the node runs.
    """

    def __init__(self, settings: Settings) -> None:
        url, secret = settings.cluster.url, node_secret_of(settings.cluster.node_secret)
        if url is None:
            raise SettingsError("cluster.url: say which database has the table of leases")
        if secret is None:
            raise SettingsError("cluster.node_secret: name the file with the secret that the services have, too")
        self._settings = settings
        self._credentials = credentials_of(settings)
        refuse_exposure(settings, self._credentials)
        self._certificate = certificate_of(settings.http, self._credentials)
        self._stopping = Event()
        self._opened = ExitStack()
        self._metrics = NodeMetrics()
        self._owners = Owners()
        self._leases = LeasesSeen(url, self._owners)
        self._links = Links(
            self._owners, trusted(None if self._credentials is None else self._credentials.certificate("ca"))
        )
        self._metrics.registry.register(
            LeaseGauges(lambda: self._owners.buckets, self._owners.without_owner, lambda: self._leases.age_s)
        )
        self.app = self._app(secret)

    def __enter__(self) -> Self:
        with self._opened:
            bound = listen(self._settings.http.host, self._settings.http.port)
            self._opened.callback(bound.close)
            proxies = [str(network) for network in self._settings.http.trusted_proxies]
            server = build_server(self.app, self._stopping, certificate=self._certificate, trusted_proxies=proxies)
            self._http = HttpThread(server, bound)
            self._opened.callback(self._http.join, HTTP_STOP_S)
            self._http.start()
            self._opened.callback(self._http.ask_to_stop)
            host, port = bound.getsockname()[:2]
            self.url = http_url(host, port, is_encrypted=self._certificate is not None)
            self._opened = self._opened.pop_all()
        _log.info("ready at %s, for the owners in the table of leases", self.url)
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._opened.close()
        _log.info("stopped")

    @property
    def is_alive(self) -> bool:
        return self._http.is_alive

    def ready(self) -> tuple[bool, Sequence[str]]:
        """Return whether this node can pass requests on, and otherwise why it cannot."""
        if self._leases.age_s is None:
            return False, [f"the table of leases cannot be read: {self._leases.problem or 'the database is asked'}"]
        return True, []

    def impaired(self) -> list[str]:
        """Return what does not work although this node passes requests on."""
        found = [f"nobody serves the sites of {bucket}" for bucket in self._owners.without_owner()]
        if self._leases.problem is not None:
            found.append(
                f"the table of leases cannot be read ({self._leases.problem}): this node goes on with the owners of "
                f"{self._leases.age_s or 0:.0f} s ago"
            )
        return found

    def _app(self, secret: bytes) -> FastAPI:
        http, authenticator = self._settings.http, keys_and_tokens_of(self._settings)
        forwarding = Forwarding(self._owners, self._links, self._metrics, self._leases.look)
        sockets = Sockets(self._owners, self._links)
        gateway = Gateway(self._owners, forwarding, sockets, self._metrics, secret, authenticator)
        return create_node_app(
            gateway,
            self._owners,
            ready=self.ready,
            impaired=self.impaired,
            registry=self._metrics.registry,
            lifespan=self._lifespan,
            authenticator=authenticator,
            rate_limiter=RateLimiter(http.requests_per_s, http.burst),
            border=border_of(http, self._credentials),
        )

    @asynccontextmanager
    async def _lifespan(self, _: FastAPI) -> AsyncIterator[None]:
        reading = asyncio.create_task(self._leases.run())
        try:
            yield
        finally:
            reading.cancel()
            with suppress(asyncio.CancelledError):
                await reading
            await self._links.close()
