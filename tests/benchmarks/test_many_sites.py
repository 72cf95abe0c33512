"""Measure what sites cost: the ingest and the engine with 1,000 sites of ten tags, and with one site of 10,000 tags.

Both get the same messages in the same order, in turns, in one run without input and output.
"""

import random
import statistics
import time

import pytest

from benchmarks import report
from benchmarks.motion import ANCHOR, MESSAGE_S, STEP_NS, TRACKS, Track, message, tracks
from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.settings.quota import Quota
from dropanchor_service.store import Sites, SiteStore
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.traffic import T0_NS

pytestmark = pytest.mark.benchmark

TAGS, SITES = 10_000, 1_000
SETTLED, STEPS = 15, 40
IDLE_TURNS = 2_000
LIMIT = 1.2  # times one site with as many tags


class Fleet:
    """The tags of `TAGS`, divided among sites. start_s: processor time of the first turn, which makes all rows."""

    def __init__(self, sites: int, motions: list[Track]) -> None:
        self._motions = motions
        self._tags_per_site = TAGS // sites
        self.clock = ManualClock()
        stores = [SiteStore(self._site(index), self._tags(index)) for index in range(sites)]
        self.bench = IngestBench(
            engine=FleetEngine(), clock=self.clock, sites=Sites([(store, Quota()) for store in stores])
        )
        began = time.process_time()
        self.bench.ingest.turn()
        self.start_s = time.process_time() - began
        self._keys = [samples_key(*self._place(tag)) for tag in range(TAGS)]

    def step(self, number: int, order: list[int]) -> float:
        """Fuse a message of every tag. Return the processor time in s."""
        self.clock.t_ns = T0_NS + (number + 1) * STEP_NS
        for tag in order:
            body = self._motions[tag % TRACKS].bodies[number]
            payload = message(body, number, tag + 1, self.clock.t_ns)
            self.bench.buffer.append(self._keys[tag], payload, "application/vnd.dropanchor.samples", self.clock.t_ns)
        began = time.process_time()
        while self.bench.ingest.turn():
            pass
        return time.process_time() - began

    def idle_s(self) -> float:
        """Return the processor time of a turn without messages, in s."""
        began = time.process_time()
        for _ in range(IDLE_TURNS):
            self.bench.ingest.turn()
        return (time.process_time() - began) / IDLE_TURNS

    def _place(self, tag: int) -> tuple[str, str]:
        return f"site-{tag // self._tags_per_site}", f"tag-{tag % self._tags_per_site}"

    def _site(self, index: int) -> Site:
        return Site(id=f"site-{index}", anchors=[Anchor(id=str(ANCHOR))])

    def _tags(self, site: int) -> dict[str, TagSettings]:
        first = site * self._tags_per_site
        return {self._place(tag)[1]: self._settings(tag) for tag in range(first, first + self._tags_per_site)}

    def _settings(self, tag: int) -> TagSettings:
        x, y, heading = self._motions[tag % TRACKS].start
        return TagSettings.model_validate({"start": {"x": x, "y": y, "heading_rad": heading}})


def test_a_thousand_sites_cost_little_more_than_one_with_as_many_tags() -> None:
    motions = tracks(STEPS * MESSAGE_S + 1.0)
    one, many = Fleet(1, motions), Fleet(SITES, motions)
    order, seconds = list(range(TAGS)), {1: list[float](), SITES: list[float]()}
    for number in range(STEPS):
        random.Random(number).shuffle(order)
        fleets = [(1, one), (SITES, many)]
        for sites, fleet in fleets if number % 2 else reversed(fleets):
            seconds[sites].append(fleet.step(number, order))
    ratio = statistics.median(m / o for m, o in zip(seconds[SITES][SETTLED:], seconds[1][SETTLED:], strict=True))
    lines = [
        f"| {sites:,} × {TAGS // sites:,} | {1e6 * statistics.median(seconds[sites][SETTLED:]) / TAGS / MESSAGE_S:.1f} "
        f"| {fleet.start_s:.2f} | {1e6 * fleet.idle_s():.1f} |"
        for sites, fleet in ((1, one), (SITES, many))
    ]
    names = "| sites × tags | µs per tag and second | s of the first turn | µs of a turn without messages |"
    table = "\n".join([names, "|---|---|---|---|", *lines])
    report.record("sites", f"{table}\n\n{SITES:,} sites cost {ratio:.2f} times as much as one in the same run.")
    fused = [fleet.bench.total(fleet.bench.metrics.poses) for fleet in (one, many)]
    assert fused[0] == fused[1] > 0.9 * TAGS * STEPS
    assert ratio <= LIMIT
