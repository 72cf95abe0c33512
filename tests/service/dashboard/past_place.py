"""A served page with a stored past."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from dropanchor_schemas.zones import EventType
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.estimation.columns import Frame, State
from dropanchor_service.events.drafts import Draft, Stay
from dropanchor_service.history.storage import Retention
from service.dashboard.place import Place, live_api_bench
from service.dashboard.zone_place import disc
from support.browser import WatchedPage
from support.http_server import running_server

SECOND = 1_000_000_000
RETENTION = Retention(SECOND, 0.1, 5 * SECOND, 10**18, 2**40)
MINUTES = 5


def write_past(place: Place, end_ns: int, *, minutes: int = MINUTES) -> None:
    """Store minutes of two tags that drive east at 1 m/s, one 5 m north of the other, and of one without north.

    The second tag is ambiguous for 10 s in the middle.
    """
    seconds = 60 * minutes
    for second in range(seconds + 1):
        t_ns = end_ns - (seconds - second) * SECOND
        unsure = seconds // 2 <= second < seconds // 2 + 10
        place.bench.move("first", x=float(second), y=0.0, speed=1.0, sigma_pos=0.2, t_ns=t_ns)
        state = State.AMBIGUOUS if unsure else State.TRACKING
        place.bench.move("second", x=float(second), y=5.0, speed=1.0, state=state, t_ns=t_ns)
        place.bench.move("turned", x=50.0, y=80.0, frame=Frame.RELATIVE, t_ns=t_ns)
    place.bench.write_history()


@contextmanager
def past_place(folder: Path) -> Iterator[tuple[Place, int]]:
    """Yield a page whose service stores the past until one hour ago, and the end of that past in ns."""
    bench = live_api_bench(folder=folder, retention=RETENTION)
    end_ns = time.time_ns() // SECOND * SECOND - 3600 * SECOND
    events = EventParts.in_memory("default")
    entered = {"t_ns": end_ns - 100 * SECOND, "since_ns": end_ns - 101 * SECOND, "zone": "dock", "name": "Dock"}
    later = {**entered, "t_ns": end_ns + 600 * SECOND}
    events.items.zones.put("ramp", disc("ramp", 155.0, 0.0, 3.0, name="Ramp"))
    drafts = [Draft(EventType.ZONE_ENTER, "first", data) for data in (entered, later)]
    events.store.commit(drafts, {}, [Stay("first", "dock", end_ns - 4000 * SECOND, end_ns - 100 * SECOND)])
    with running_server(bench.app(DASHBOARD, events=events), bench.stopping) as port:
        place = Place(bench, f"http://127.0.0.1:{port}/")
        write_past(place, end_ns)
        place.move("first", x=-3.0, y=-3.0)
        yield place, end_ns


def iso(t_ns: int) -> str:
    return datetime.fromtimestamp(t_ns / SECOND, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"


def link_to(place: Place, end_ns: int, at_s: float, **more: str) -> str:
    """Return the address of a moment, seconds after the start of the stored past."""
    from_ns = end_ns - 60 * MINUTES * SECOND
    values = {"from": iso(from_ns), "to": iso(end_ns), "at": iso(from_ns + round(at_s * SECOND))} | more
    return f"{place.url}#" + "&".join(f"{name}={value}" for name, value in values.items())


def wait_for_past(page: WatchedPage, tags: int) -> None:
    page.wait_for(f"dropanchor.past() && !dropanchor.past().loading && dropanchor.tags().length === {tags}")
