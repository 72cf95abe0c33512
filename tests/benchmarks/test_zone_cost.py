"""Measure what zones cost: 10,000 tags that move among zones, 5 poses a second each, one in twenty ambiguous.

Once one site has all of them and 100 zones, and once each of 1,000 sites has ten tags and ten zones.
"""

import time

import numpy as np
import pytest

from benchmarks import report
from dropanchor_schemas.zones import Polygon, Zone
from dropanchor_service.engines.warm_up import warm_up_zones
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, Array, State
from dropanchor_service.store import LatestPoses
from dropanchor_service.store.groups import Groups
from dropanchor_service.zones.modes import placed
from dropanchor_service.zones.zone_watch import ZoneWatch

pytestmark = pytest.mark.benchmark

TAGS, ZONES, CORNERS = 10_000, 100, 8
SITES = 1_000
SITE_M, SETTLED, TURNS = 200.0, 10, 60
POSES_PER_S = 5.0  # of a tag that sends 5 messages a second
AMBIGUOUS, HYPOTHESES = 20, 4  # every 20th tag has 4
LIMIT = 0.1  # of a core


def zones(rng: np.random.Generator) -> list[Zone]:
    """Return a star with eight corners in each of 10 × 10 squares of 20 m."""
    found = []
    for number in range(ZONES):
        angle, radius = np.sort(rng.uniform(0, 2 * np.pi, CORNERS)), rng.uniform(5, 9, CORNERS)
        x, y = 20 * (number % 10) + 10 + radius * np.cos(angle), 20 * (number // 10) + 10 + radius * np.sin(angle)
        shape = Polygon(type="polygon", points=np.column_stack([x, y]).tolist())
        found.append(Zone(id=str(number), shape=shape, dwell_s=60.0, speed_mps=3.0))
    return found


def fleet(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the poses and hypotheses of all tags. Their standard deviations are 0.1 to 0.8 m."""
    poses = np.zeros(TAGS, POSE)
    poses["row"], poses["state"], poses["p_mode"] = np.arange(TAGS), State.TRACKING, 0.999
    std = rng.uniform(0.1, 0.8, TAGS)
    poses["cov"][:, 0, 0], poses["cov"][:, 1, 1] = std**2, (0.6 * std) ** 2
    poses["state"][::AMBIGUOUS] = State.AMBIGUOUS
    hypotheses = np.zeros(HYPOTHESES * len(poses[::AMBIGUOUS]), HYPOTHESIS)
    hypotheses["row"], hypotheses["weight"] = np.repeat(poses["row"][::AMBIGUOUS], HYPOTHESES), 1 / HYPOTHESES
    hypotheses["x"], hypotheses["y"] = rng.uniform(0, SITE_M, (2, len(hypotheses)))
    hypotheses["cov"] = 0.3 * np.eye(2)
    return poses, hypotheses


def measured(sites: int, zones_per_site: int) -> tuple[float, float]:
    """Return the processor time of a turn, s, and the events per second. The area grows with the zones of a site."""
    rng = np.random.default_rng(1)
    watch, latest, own = ZoneWatch(sites), LatestPoses(), zones(rng)[:zones_per_site]
    for site in range(sites):
        watch.set_zones(own, Groups(), site)
    watch.add_tags([f"tag-{row}" for row in range(TAGS)], [row * sites // TAGS for row in range(TAGS)])
    poses, hypotheses = fleet(rng)
    area = np.array([SITE_M, SITE_M * zones_per_site / ZONES])
    hypotheses["y"] *= zones_per_site / ZONES
    places, velocity = rng.uniform(0, 1, (TAGS, 2)) * area, rng.normal(0, 1, (TAGS, 2))
    seconds, changes = [], 0
    for turn in range(TURNS):
        places = (places + velocity / POSES_PER_S) % area
        poses["x"], poses["y"] = places.T
        poses["t_ns"] = (turn + 1) * 1e9 / POSES_PER_S
        latest.write(poses, hypotheses)
        began = time.process_time()
        found = list(watch.judge(placed(poses, np.zeros(TAGS), latest)))
        seconds.append(time.process_time() - began)
        changes += len(found) if turn >= SETTLED else 0
    return float(np.mean(seconds[SETTLED:])), changes / (TURNS - SETTLED) * POSES_PER_S


def test_the_cost_of_zones_is_measured() -> None:
    warm_up_zones()
    lines, costs = [], []
    for sites, zones_per_site in ((1, ZONES), (SITES, ZONES // 10)):
        cost, events_per_s = measured(sites, zones_per_site)
        costs.append(cost)
        lines.append(
            f"| {sites:,} | {TAGS // sites:,} × {zones_per_site} | {1e3 * cost:.1f} | {cost * POSES_PER_S:.3f} "
            f"| {events_per_s:.0f} |"
        )
    head = "| sites | tags × zones of each | ms per turn | share of a core at 5 Hz | events per second |"
    report.record("zones", "\n".join([head, "|---|---|---|---|---|", *lines]))
    assert max(costs) * POSES_PER_S <= LIMIT
