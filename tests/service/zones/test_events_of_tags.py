"""Tags make events by probability, after a delay, and never because something is unknown."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_schemas.plans import Floor
from dropanchor_schemas.site import TagSettings
from dropanchor_schemas.zones import AmbiguousRule, BatteryLowRule, LostRule, TooCloseRule
from dropanchor_service.estimation.columns import Frame, HeightSource, State, StateReason
from dropanchor_service.store.floors import floors_of
from support.events import EventBench, S, circle


def test_a_tag_enters_after_the_delay_and_leaves_after_the_delay() -> None:
    bench = EventBench()
    bench.put(circle(delay_s=1.0))
    assert bench.stay(1.0, "a", x=20.0) == []
    assert bench.stay(1.0, "a", x=0.0) == []
    assert bench.stay(0.4, "a", x=0.0) == ["zone.enter a"]
    assert bench.stay(0.8, "a", x=20.0) == []
    assert bench.stay(5.0, "a", x=0.0) == []
    assert bench.stay(1.4, "a", x=20.0) == ["zone.exit a"]
    entered, left = bench.events()
    assert entered.data.zone == "dock"
    assert entered.data.t_ns - entered.data.since_ns == S
    assert entered.data.probability is not None
    assert entered.data.probability > 0.99
    assert (left.sequence, left.source, left.specversion) == ("2".zfill(20), "urn:dropanchor:site:yard", "1.0")
    assert entered.id != left.id


def test_a_tag_near_the_edge_neither_enters_nor_leaves() -> None:
    bench = EventBench()
    bench.put(circle())
    assert bench.stay(5.0, "a", x=4.9) == []
    assert bench.stay(2.0, "a", x=0.0) == ["zone.enter a"]
    assert bench.stay(5.0, "a", x=5.1) == []


def test_an_ambiguous_tag_enters_only_where_nine_tenths_of_it_are() -> None:
    bench = EventBench()
    bench.put(circle())
    assert bench.ambiguous(5.0, "a", [(0.6, 0.0, 0.0), (0.4, 30.0, 0.0)]) == []
    assert bench.ambiguous(5.0, "a", [(0.45, 0.0, 0.0), (0.4, 30.0, 0.0)]) == []
    assert bench.ambiguous(2.0, "a", [(0.6, 0.0, 1.0), (0.35, 1.0, 0.0), (0.05, 30.0, 0.0)]) == ["zone.enter a"]
    assert bench.ambiguous(5.0, "a", [(0.6, 30.0, 0.0), (0.4, 0.0, 0.0)]) == []
    assert bench.ambiguous(2.0, "a", [(0.6, 30.0, 0.0), (0.38, -30.0, 0.0)]) == ["zone.exit a"]


@pytest.mark.parametrize(
    "unknown",
    [
        {"frame": Frame.RELATIVE},
        {"state": State.INITIALISING},
        {"state": State.LOST},
        {"x": math.nan},
        {"cov": np.full((3, 3), math.nan)},
        {"p_mode": 0.5},
        {"t_ns": 1},
    ],
    ids=str,
)
def test_what_is_not_known_changes_nothing(unknown: dict[str, object]) -> None:
    bench = EventBench()
    bench.put(circle())
    assert bench.stay(5.0, "a", **{"x": 0.0} | unknown) == []
    assert bench.stay(2.0, "a", x=0.0) == ["zone.enter a"]
    assert bench.stay(5.0, "a", **{"x": 30.0} | unknown) == []


def test_a_zone_of_a_floor_takes_the_tags_whose_height_is_there() -> None:
    bench = EventBench()
    bench.put(circle(z_min_m=3.0, z_max_m=6.0), circle("below", z_max_m=3.0))
    height = {"z_std": 0.3, "z_source": HeightSource.PRESSURE}
    assert bench.stay(2.0, "a", x=0.0, z=1.0, **height) == ["zone.enter a"]
    assert bench.stay(2.0, "a", x=0.0, z=2.9, **height) == []  # between the two
    assert bench.stay(2.0, "a", x=0.0, z=4.0, **height) == ["zone.enter a", "zone.exit a"]
    assert [event.data.zone for event in bench.events()] == ["below", "dock", "below"]
    assert bench.stay(2.0, "a", x=0.0, z=4.0, **height | {"z_std": 2.0}) == []
    assert bench.stay(2.0, "a", x=30.0, z=4.0, **height) == ["zone.exit a"]


@pytest.mark.parametrize(
    "unknown", [{"z": math.nan}, {"z": 1.0, "z_std": 0.15, "z_source": HeightSource.START}], ids=["unknown", "untold"]
)
def test_a_tag_whose_height_is_not_known_enters_no_zone_with_heights_and_may_leave_it(
    unknown: dict[str, float],
) -> None:
    bench = EventBench()
    bench.put(circle(z_min_m=-1.0, z_max_m=3.0))
    assert bench.stay(2.0, "a", x=0.0, **unknown) == []
    assert bench.stay(2.0, "a", x=0.0, z=1.2, z_std=0.15) == ["zone.enter a"]
    assert bench.stay(5.0, "a", x=0.0, **unknown) == []
    assert bench.stay(2.0, "a", x=30.0, **unknown) == ["zone.exit a"]


def test_a_silence_starts_the_delay_again() -> None:
    bench = EventBench()
    bench.put(circle(delay_s=3.0))
    bench.stay(1.0, "a", x=0.0)
    bench.stay(6.0)
    assert bench.stay(2.0, "a", x=0.0) == []
    assert bench.stay(2.0, "a", x=0.0) == ["zone.enter a"]


def test_a_clock_that_jumps_makes_no_event() -> None:
    bench = EventBench()
    bench.put(circle(delay_s=3.0, dwell_s=60.0))
    bench.stay(1.0, "a", x=0.0)
    bench.poses.now_ns += 3600 * S
    assert bench.stay(1.0, "a", x=0.0) == []
    bench.poses.now_ns -= 7200 * S
    assert bench.stay(1.0, "a", x=0.0) == []
    assert bench.stay(3.0, "a", x=0.0) == ["zone.enter a"]
    bench.poses.now_ns -= 7200 * S
    assert bench.stay(50.0, "a", x=0.0) == []


def test_dwell_comes_once_per_stay_and_speed_once_until_the_tag_is_slow() -> None:
    bench = EventBench()
    bench.put(circle(enter=False, exit=False, dwell_s=10.0, speed_mps=2.0))
    assert bench.stay(10.0, "a", x=0.0, speed=1.0) == []
    assert bench.stay(30.0, "a", x=0.0, speed=1.0) == ["zone.dwell a"]
    assert bench.stay(5.0, "a", x=0.0, speed=3.0) == ["zone.speed a"]
    assert bench.stay(5.0, "a", x=0.0, speed=1.9) == []
    assert bench.stay(5.0, "a", x=0.0, speed=3.0) == []
    bench.stay(1.0, "a", x=0.0, speed=1.0)
    assert bench.stay(5.0, "a", x=0.0, speed=3.0) == ["zone.speed a"]
    bench.stay(5.0, "a", x=30.0)
    assert bench.stay(15.0, "a", x=0.0, speed=1.0) == ["zone.dwell a"]


def test_a_zone_concerns_its_tags_and_groups_only() -> None:
    bench = EventBench()
    site = bench.poses.answers.site
    site.set_tag("b", TagSettings(group="carts of hall 2"))
    bench.put(circle(tags=["a"], groups=["carts of hall 2", "missing"]))
    assert bench.stay(2.0, "a", "b", "c", x=0.0) == ["zone.enter a", "zone.enter b"]
    site.set_tag("c", TagSettings(group="carts of hall 2"))
    assert bench.stay(2.0, "a", "b", "c", x=0.0) == ["zone.enter c"]


def test_an_edited_zone_keeps_who_is_inside_and_a_deleted_one_forgets() -> None:
    bench = EventBench()
    bench.put(circle(), circle("other", x=0.0))
    bench.stay(2.0, "a", x=0.0)
    bench.put(circle(radius_m=8.0, name="dock"))
    assert bench.stay(3.0, "a", x=0.0) == []
    bench.items.zones.remove("other")
    bench.stay(1.0, "a", x=0.0)
    assert {key.item for key in bench.store.states()} == {"dock"}
    bench.put(circle("other"))
    assert bench.stay(2.0, "a", x=0.0) == ["zone.enter a"]


def test_two_tags_that_come_too_close_make_one_event_per_approach() -> None:
    bench = EventBench()
    bench.put(rules=[TooCloseRule(id="apart", type="too_close", distance_m=3.0)])
    bench.poses.move("c", x=50.0)
    places = {"a": 0.0, "b": 1.0}

    def stay(seconds: float) -> list[str]:
        found = []
        for _ in range(round(seconds / 0.2)):
            bench.poses.move("c", x=50.0, state=State.TRACKING)
            for name, x in places.items():
                bench.poses.move(name, x=x)
            found += bench.stay(0.2)
        return found

    assert stay(3.0) == ["tags.too_close a"]
    assert stay(3.0) == []
    assert bench.events()[0].data.other_tag == "b"
    assert bench.events()[0].data.distance_m == 1.0
    places["b"] = 3.0
    assert stay(3.0) == []
    places["b"] = 9.0
    stay(2.0)
    places["b"] = 2.0
    assert stay(3.0) == ["tags.too_close a"]


LEVEL = {"z": 0.0, "z_std": 0.2, "z_source": HeightSource.PRESSURE}


@pytest.mark.parametrize(
    ("above", "is_close"),
    [
        (LEVEL | {"z": 2.0}, True),
        (LEVEL | {"z": 2.85}, False),  # 3.02 m apart; flat it would be 1 m
        (LEVEL | {"z": 28.8}, False),
        (LEVEL | {"z": 2.0, "z_std": 1.5}, False),
        (LEVEL | {"z": 28.8, "z_source": HeightSource.START}, True),  # a height that is not in the frame of the site
        (LEVEL | {"z": math.nan}, True),
    ],
)
def test_heights_that_are_known_keep_tags_apart(above: dict[str, Any], is_close: bool) -> None:
    bench = EventBench()
    bench.put(rules=[TooCloseRule(id="apart", type="too_close", distance_m=3.0)])
    found = []
    for _ in range(15):
        bench.poses.move("a", x=0.0, **LEVEL)
        bench.poses.move("b", x=1.0, **above)
        found += bench.stay(0.2)
    assert found == (["tags.too_close a"] if is_close else [])


def test_tags_on_two_floors_are_not_close_and_a_pair_parts_when_one_takes_the_lift() -> None:
    bench = EventBench()
    bench.poses.answers.site.floors = floors_of(
        [Floor(name="0", bottom_m=-1, top_m=3), Floor(name="1", bottom_m=3, top_m=7)]
    )
    bench.put(rules=[TooCloseRule(id="apart", type="too_close", distance_m=12.0)])

    def stay(z: float) -> list[str]:
        found = []
        for _ in range(15):
            bench.poses.move("a", x=0.0, **LEVEL | {"z": 1.0})
            bench.poses.move("b", x=1.0, **LEVEL | {"z": z})
            found += bench.stay(0.2)
        return found

    assert stay(4.5) == []
    assert stay(1.0) == ["tags.too_close a"]
    assert stay(4.5) == []
    assert stay(1.0) == ["tags.too_close a"]  # they were apart meanwhile


def test_a_low_battery_a_lost_and_an_ambiguous_tag_make_one_event_each() -> None:
    bench = EventBench()
    bench.put(
        rules=[
            BatteryLowRule(id="battery", type="battery_low"),
            LostRule(id="lost", type="lost", after_s=20.0),
            AmbiguousRule(id="ambiguous", type="ambiguous", after_s=5.0),
        ]
    )
    bench.stay(1.0, "a", x=0.0)
    bench.health.record(0, {"battery_fraction": 0.15}, 1)
    assert bench.stay(3.0, "a", x=0.0) == ["tag.battery_low a"]
    bench.health.record(0, {"battery_fraction": 0.22}, 1)
    bench.stay(2.0, "a", x=0.0)
    bench.health.record(0, {"battery_fraction": 0.15}, 1)
    assert bench.stay(2.0, "a", x=0.0) == []
    assert bench.ambiguous(7.0, "a", [(0.5, 0.0, 0.0), (0.5, 9.0, 0.0)]) == ["tag.ambiguous a"]
    assert bench.stay(5.0, "a", x=0.0, reason=StateReason.RESOLVED) == []
    assert bench.stay(20.0) == []
    assert bench.stay(15.0) == ["tag.lost a"]
    assert bench.stay(60.0) == []
