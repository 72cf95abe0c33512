"""Simulated tags in a grid of zones: events from probability and from the bare dot, compared with the truth."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely

from dropanchor_evaluation.simulated import PriorKnowledge, batches, configure, merged, samples_of
from dropanchor_schemas.zones import Polygon, Zone
from dropanchor_service.estimation.columns import Array, Frame, State
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.store import LatestPoses
from dropanchor_service.store.groups import Groups
from dropanchor_service.zones.judge import ENTER
from dropanchor_service.zones.modes import placed
from dropanchor_service.zones.zone_watch import ZoneWatch
from dropanchor_tag_client.simulator.simulation import Simulation

STEP_S = 0.2
DELAY_NS = 1_000_000_000
SIDE_M, PITCH_M, REACH_M = 16.0, 24.0, 72.0


def zones() -> list[Zone]:
    """Return squares all over the site."""
    corners = np.arange(-REACH_M, REACH_M, PITCH_M).tolist()
    square = ((0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M))
    return [
        Zone(
            id=f"{x:g},{y:g}",
            delay_s=DELAY_NS * 1e-9,
            shape=Polygon(type="polygon", points=[[x + dx, y + dy] for dx, dy in square]),
        )
        for x in corners
        for y in corners
    ]


@dataclass
class Score:
    """events: enters and exits. false: those of a tag that was never on that side while the condition held."""

    events: int = 0
    false: int = 0

    def __str__(self) -> str:
        return f"{self.false} of {self.events} ({100 * self.false / max(self.events, 1):.1f} %)"


@dataclass
class Comparison:
    """The same drives, judged by probability, by the dot after the same delay, and by the dot alone."""

    probability: Score = field(default_factory=Score)
    delayed_dot: Score = field(default_factory=Score)
    dot: Score = field(default_factory=Score)
    states: set[State] = field(default_factory=set)


class Dots:
    """Which dots are in which zones, after a delay."""

    def __init__(self, tags: int, shapes: list[shapely.Polygon], delay_ns: int) -> None:
        self._shapes = shapes
        self._delay_ns = delay_ns
        self._inside = np.zeros((tags, len(shapes)), bool)
        self._since_ns = np.zeros((tags, len(shapes)), np.int64)

    def judge(self, poses: Array) -> Iterator[tuple[int, int, int, int, bool]]:
        """Yield row, zone, since, time and whether the dot is inside now, for every change."""
        known = poses[(poses["frame"] == Frame.SITE) & np.isfinite(poses["x"])]
        rows, t_ns = known["row"], known["t_ns"]
        for z, shape in enumerate(self._shapes):
            inside = shapely.contains_xy(shape, known["x"], known["y"])
            differs = inside != self._inside[rows, z]
            since_ns = np.where(self._since_ns[rows, z] == 0, t_ns, self._since_ns[rows, z])
            self._since_ns[rows, z] = np.where(differs, since_ns, 0)
            for i in np.flatnonzero(differs & (t_ns - since_ns >= self._delay_ns)).tolist():
                self._inside[rows[i], z], self._since_ns[rows[i], z] = inside[i], 0
                yield int(rows[i]), z, int(since_ns[i]), int(t_ns[i]), bool(inside[i])


def compare(runs: list[Simulation], known: PriorKnowledge, into: Comparison) -> None:
    """Drive the tags through the zones, and add to the scores."""
    watched = zones()
    shapes = [shapely.Polygon(zone.shape.points) for zone in watched if isinstance(zone.shape, Polygon)]
    truth = [[shapely.contains_xy(shape, run.truth.x, run.truth.y) for shape in shapes] for run in runs]
    number = {zone.id: index for index, zone in enumerate(watched)}
    watch, latest, version = ZoneWatch(), LatestPoses(), 0
    watch.set_zones(watched, Groups())
    watch.add_tags([str(row) for row in range(len(runs))])
    delayed, plain = Dots(len(runs), shapes, DELAY_NS), Dots(len(runs), shapes, 0)

    def count(score: Score, row: int, zone: int, since_ns: int, t_ns: int, inside: bool) -> None:
        t_s = runs[row].truth.t_s
        during = (t_s >= since_ns * 1e-9 - 0.01) & (t_s <= t_ns * 1e-9 + 0.01)
        score.events += 1
        score.false += not (truth[row][zone][during] == inside).any()

    engine = FleetEngine()
    configure(engine, runs, known)
    samples = merged([samples_of(run, known.feed, known.heading_std, row) for row, run in enumerate(runs)])
    for batch in batches(samples, STEP_S):
        found = engine.process(batch)
        latest.write(found.poses, found.hypotheses)
        version, poses = latest.since(version)
        into.states |= set(map(State, poses["state"].tolist()))
        for change in watch.judge(placed(poses, np.zeros(len(poses)), latest)):
            row, since_ns, inside = change.row, change.since_ns, change.kind == ENTER
            count(into.probability, row, number[change.zone.id], since_ns, change.t_ns, inside)
        for row, zone, since_ns, t_ns, inside in delayed.judge(poses):
            count(into.delayed_dot, row, zone, since_ns, t_ns, inside)
        for row, zone, _, t_ns, inside in plain.judge(poses):
            count(into.dot, row, zone, t_ns - DELAY_NS, t_ns, inside)
