"""What the routes of all sites of an application share."""

import time
from dataclasses import dataclass, field
from threading import Event
from typing import TYPE_CHECKING

from starlette.requests import HTTPConnection

from dropanchor_service.api.http.borders import ANY_HOST, Border
from dropanchor_service.api.http.connections import OpenConnections
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.simulated_tags import SimulatedTags
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.identity import Authenticator

if TYPE_CHECKING:
    from dropanchor_service.basemap.basemap import ServedBasemap  # an extra


@dataclass(frozen=True)
class SharedParts:
    """stopping: ends the streams when set. endpoints: those of the Zenoh router, as configured. credentials: those of
    the tags; None when they need none. authenticator: None when every client may do everything. rate_limiter: limits
    the requests of each client; None for no limit. border: which hosts and web pages may use the interface. basemap:
    None when there is none. sample_connections, feed_connections: WebSockets that send samples, and those of omlox.
    url: where the service listens; its host may stand for all interfaces. simulated: tags that somebody started.
    """

    stopping: Event
    endpoints: tuple[str, ...] = ()
    credentials: SecurityFolder | None = None
    authenticator: Authenticator | None = None
    rate_limiter: RateLimiter | None = None
    border: Border = ANY_HOST
    basemap: "ServedBasemap | None" = None
    started_ns: int = field(default_factory=time.time_ns)
    sample_connections: OpenConnections = field(default_factory=OpenConnections)
    feed_connections: OpenConnections = field(default_factory=OpenConnections)
    url: str | None = None
    simulated: SimulatedTags = field(default_factory=SimulatedTags)

    @property
    def may_simulate(self) -> bool:
        """Whether the service can start simulated tags itself."""
        return self.credentials is None and bool(self.endpoints)


def shared_of(connection: HTTPConnection) -> SharedParts:
    """Return those of the application that a request came to: `create_app` puts them into its state."""
    shared: SharedParts = connection.app.state.shared
    return shared
