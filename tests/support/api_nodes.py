"""An API node before services, all of them real HTTP servers on loopback, and no database."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from threading import Event

from fastapi import FastAPI
from starlette.types import ASGIApp

from dropanchor_service.api.http.borders import Border
from dropanchor_service.api.http.of_cluster import FromNodes, NamesOwner
from dropanchor_service.metrics.node import LeaseGauges, NodeMetrics
from dropanchor_service.node.app import create_node_app
from dropanchor_service.node.forwarding import Forwarding
from dropanchor_service.node.gateway import Gateway
from dropanchor_service.node.links import Links, trusted
from dropanchor_service.node.owners import Owner, Owners
from dropanchor_service.node.sockets import Sockets
from dropanchor_service.security.identity import Authenticator
from support.http_server import running_server

SECRET = b"a secret of the tests"


def of_owner(app: ASGIApp, bucket: str, epoch: int = 1, secret: bytes | None = SECRET) -> ASGIApp:
    """Return an application as the owner of a bucket has it."""
    return NamesOwner(FromNodes(app, secret), bucket, epoch)


@contextmanager
def running_owner(app: ASGIApp, bucket: str, epoch: int = 1, secret: bytes | None = SECRET) -> Iterator[Owner]:
    """Serve it on loopback until the block ends."""
    with running_server(of_owner(app, bucket, epoch, secret), Event()) as port:
        yield Owner(bucket, epoch, f"owner of {bucket}", f"http://127.0.0.1:{port}")


class BareNode:
    """A node without a table of leases: a test says who owns what."""

    def __init__(
        self,
        authenticator: Authenticator | None = None,
        cors_origins: tuple[str, ...] = (),
        authority: Path | None = None,
    ) -> None:
        """authority: certificate of who signs the owners' certificates, besides the usual ones."""
        self.owners, self.metrics = Owners(), NodeMetrics()
        links = Links(self.owners, trusted(authority))
        forwarding = Forwarding(self.owners, links, self.metrics, lambda: None)
        sockets = Sockets(self.owners, links)
        self._links = links
        self._loop: asyncio.AbstractEventLoop | None = None
        gauges = LeaseGauges(lambda: self.owners.buckets, self.owners.without_owner, lambda: 0.0)
        self.metrics.registry.register(gauges)
        self.app = create_node_app(
            Gateway(self.owners, forwarding, sockets, self.metrics, SECRET, authenticator),
            self.owners,
            ready=lambda: (True, []),
            impaired=list,
            registry=self.metrics.registry,
            lifespan=self._lifespan,
            authenticator=authenticator,
            border=Border(origins=cors_origins),
        )

    @asynccontextmanager
    async def _lifespan(self, _: FastAPI) -> AsyncIterator[None]:
        self._loop = asyncio.get_running_loop()
        yield
        await self._links.close()

    def take(self, *owners: Owner) -> None:
        """Let the node know the owners, as if it had read the table of leases."""
        assert self._loop is not None

        async def take() -> None:
            self.owners.take(owners)

        asyncio.run_coroutine_threadsafe(take(), self._loop).result(10.0)

    @contextmanager
    def running(self, *owners: Owner) -> Iterator[str]:
        """Serve the node on loopback until the block ends. Yield its address."""
        with running_server(self.app, Event()) as port:
            self.take(*owners)
            yield f"http://127.0.0.1:{port}"
