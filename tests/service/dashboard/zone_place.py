"""A served page whose zones are watched whenever the test says so."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from dropanchor_schemas.zones import Circle, Polygon, Zone
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.events.site_watch import WatchedSite
from dropanchor_service.events.thread import EventThread, Retention
from dropanchor_service.events.watcher import Watcher
from dropanchor_service.security.identity import Authenticator
from dropanchor_service.store import HealthTable
from service.dashboard.place import Place, live_api_bench
from support.http_server import running_server

KEEP = Retention(keep_ns=10**18, max_bytes=2**40)


@dataclass
class ZonePlace(Place):
    """parts: what the interface reads and changes. watch: judges the poses against the zones."""

    parts: EventParts
    watch: EventThread

    def put(self, *zones: Zone) -> None:
        for zone in zones:
            self.parts.items.zones.put(zone.id, zone)

    def go(self, tag: str, x: float, y: float, **fields: Any) -> None:
        """Move a tag now, and judge the zones."""
        self.move(tag, x=x, y=y, **({"t_ns": time.time_ns()} | fields))
        self.watch.turn()

    @property
    def zones(self) -> dict[str, Zone]:
        return dict(self.parts.items.zones.all)


def square(zone: str, left: float, bottom: float, side: float = 4.0, **fields: Any) -> Zone:
    """Return a square zone whose events need no delay."""
    corners = [[left, bottom], [left + side, bottom], [left + side, bottom + side], [left, bottom + side]]
    return Zone(id=zone, shape=Polygon(type="polygon", points=corners), **({"delay_s": 0.0} | fields))


def disc(zone: str, x: float, y: float, radius_m: float, **fields: Any) -> Zone:
    """Return a round zone whose events need no delay."""
    return Zone(id=zone, shape=Circle(type="circle", x=x, y=y, radius_m=radius_m), **({"delay_s": 0.0} | fields))


def zone_place() -> ZonePlace:
    """Return a place that nobody serves yet."""
    bench = live_api_bench()
    parts = EventParts.in_memory("yard")
    site = WatchedSite(bench.answers.site, bench.answers.tags, HealthTable(), parts.items)
    watch = EventThread(Watcher([site], bench.answers.latest, time.time_ns), [parts.store], KEEP, time.time_ns, 0.1)
    return ZonePlace(bench, "", parts, watch)


@contextmanager
def served(place: ZonePlace, authenticator: Authenticator | None = None, port: int = 0) -> Iterator[int]:
    """Serve the place until the block ends. Yield the port."""
    app = place.bench.app(DASHBOARD, authenticator=authenticator, events=place.parts)
    with running_server(app, place.bench.stopping, port) as found:
        place.url = f"http://127.0.0.1:{found}/"
        yield found
