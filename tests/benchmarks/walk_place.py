"""The page that an operator walks through: a site with tags, some minutes of history, zones, alerts and plans."""

import ipaddress
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from dropanchor_schemas.site import Anchor, Georeference, Site, TagSettings
from dropanchor_service.api.app import DASHBOARD
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.estimation.columns import State
from dropanchor_service.history.storage import Retention
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings
from service.dashboard.place import Place, live_api_bench
from support.http_server import running_server

SECOND = 1_000_000_000
RETENTION = Retention(SECOND, 0.1, 5 * SECOND, 10**18, 2**40)
PAST_S, STEP_S = 480, 5
SPACING_M = 3.0


@dataclass
class WalkPlace(Place):
    """labels: what people call the tags. events, plans: what the page changes besides the site."""

    labels: list[str]
    events: EventParts
    plans: PlanStore


@contextmanager
def walk_place(folder: Path, tags: int) -> Iterator[WalkPlace]:
    """Serve a site whose tags have moved for some minutes."""
    site = Site(id="werk", anchors=[Anchor(id="1", x=0, y=0)], georeference=Georeference(lat=52.0, lon=13.0))
    bench, plans = live_api_bench(site, folder, RETENTION), PlanStore(None)
    networks = (ipaddress.ip_network("127.0.0.0/8"),)
    channels = Channels(DeliverySettings(allow_networks=networks), EmailSettings(), MqttSettings())
    events = replace(EventParts.in_memory("werk"), channels=channels)
    with running_server(bench.app(DASHBOARD, events=events, plans=plans), bench.stopping) as port:
        labels = [f"Stapler {number}" for number in range(1, tags + 1)]
        place = WalkPlace(bench, f"http://127.0.0.1:{port}/", labels, events, plans)
        for number, label in enumerate(labels, 1):
            bench.answers.tags.register(f"tag-{number:03}")
            bench.answers.site.set_tag(f"tag-{number:03}", TagSettings(name=label))
        _drive(place, tags)
        yield place


def _drive(place: WalkPlace, tags: int) -> None:
    """Store how the tags drove, and leave them where poses stay fresh. The last one is lost by now."""
    names, side = [f"tag-{number:03}" for number in range(1, tags + 1)], math.ceil(math.sqrt(tags))
    now_ns = time.time_ns()
    for second in range(0, PAST_S, STEP_S):
        xs = [(i % side) * SPACING_M - second / 100 for i in range(tags)]
        ys = [(i // side) * SPACING_M for i in range(tags)]
        place.move(*names, x=xs, y=ys, speed=0.5, t_ns=now_ns - (PAST_S - second) * SECOND)
    place.bench.write_history()
    place.move(*names, x=xs, y=ys, speed=0.5, range=5.0, t_ns=now_ns + 600 * SECOND)
    place.move(names[-1], x=xs[-1], y=ys[-1], state=State.LOST, t_ns=now_ns + 600 * SECOND)
