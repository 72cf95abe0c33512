"""Rows that know north by themselves go on when the site's declination changes; the others start again."""

import math
from dataclasses import dataclass, field

import numpy as np

from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.north import NORTH
from dropanchor_service.ingest.norths import AT_ONCE, EVERY_NS, NorthWatch
from dropanchor_service.store.norths import North, Norths
from support.ingest import IngestBench, TransparentEngine

START = StartPose(x=1.0, y=2.0, heading_rad=0.3)


@dataclass
class Knowing(TransparentEngine):
    """An engine whose even rows know north, until they have left their start."""

    left: set[int] = field(default_factory=set)
    asked: list[int] = field(default_factory=list)
    turned: dict[int, float] = field(default_factory=dict)

    def norths(self, rows: Array) -> Array:
        self.asked += rows.tolist()
        return np.array([(row, 0.1 * row, 0.05) for row in rows.tolist() if row % 2 == 0], NORTH)

    def turn_north(self, row: int, declination: float) -> bool:
        if row % 2 == 0:
            self.turned[row] = declination
        return row % 2 == 0

    def are_at_start(self, rows: Array) -> Array:
        at_start: Array = ~np.isin(rows, list(self.left))
        return at_start


def watch_of(engine: TransparentEngine, tags: int) -> tuple[NorthWatch, Norths]:
    norths = Norths()
    watch = NorthWatch(engine, norths)
    for row in range(tags):
        watch.tell(row, TagSettings(start=START))
    return watch, norths


def test_what_rows_tell_is_known_within_a_second_and_forgotten_with_their_start() -> None:
    watch, norths = watch_of(Knowing(), 3)
    watch.look(EVERY_NS)
    assert [row for row, _ in norths.all()] == [0, 2]
    assert norths.of(2) == North(0.2, 0.05)
    watch.tell(2, TagSettings())
    assert norths.of(2) is None
    watch.look(2 * EVERY_NS)
    assert [row for row, _ in norths.all()] == [0]


def test_only_rows_with_a_told_heading_and_a_magnetometer_are_asked() -> None:
    engine = Knowing()
    watch, _ = watch_of(engine, 0)
    for row, settings in enumerate(
        (
            TagSettings(),
            TagSettings(start=StartPose(x=0.0, y=0.0)),
            TagSettings(start=START, heading_source="platform"),
            TagSettings(start=START),
        )
    ):
        watch.tell(row, settings)
    watch.look(EVERY_NS)
    assert engine.asked == [3]


def test_in_a_large_fleet_the_rows_take_turns() -> None:
    engine = Knowing()
    watch, norths = watch_of(engine, 3 * AT_ONCE)
    for second in range(1, 4):
        watch.look(second * EVERY_NS)
        watch.look(second * EVERY_NS + 1)
    assert sorted(engine.asked) == list(range(3 * AT_ONCE))
    assert len(norths.all()) == 3 * AT_ONCE // 2


def test_an_engine_that_learns_no_north_is_left_alone() -> None:
    watch, norths = watch_of(TransparentEngine(), 2)
    watch.look(EVERY_NS)
    assert not norths.all()
    assert not watch.turns(0, 1.0)


def test_a_new_declination_restarts_only_rows_that_do_not_know_north_and_none_at_a_start_that_it_has_left() -> None:
    engine = Knowing()
    bench = IngestBench(engine=engine)
    for tag, start in (("a", START), ("b", START), ("c", START), ("d", START), ("e", None), ("f", None)):
        bench.site.set_tag(tag, TagSettings(start=start))
        bench.send(tag, Frame(ranges=[RangeSample(bench.clock.now_ns(), 1, 5.0)]))
    engine.left = {1}
    before = {row: len(made) for row, made in engine.configured.items()}
    bench.site.set_site(bench.site.site.model_copy(update={"declination_rad": 0.4, "declination_std_rad": 0.2}))
    bench.guarded_engine.follow_sites()
    made = {row: len(made) - before[row] for row, made in engine.configured.items()}
    assert made == {0: 0, 1: 1, 2: 0, 3: 1, 4: 0, 5: 1}
    assert engine.turned == {0: 0.4, 2: 0.4, 4: 0.4}
    assert [bool(engine.configured[row][-1]["start_known"]) for row in (1, 3, 5)] == [False, True, False]
    assert all(math.isclose(engine.configured[row][-1]["declination"], 0.4) for row in (1, 3, 5))
    assert all(math.isclose(engine.configured[row][-1]["declination_std"], 0.2) for row in (1, 3, 5))
