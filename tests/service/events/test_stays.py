"""How long tags were in zones: by certain entries and exits, and never longer than is known."""

from pathlib import Path

import pytest

from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.columns import State
from dropanchor_service.events.drafts import Stay
from dropanchor_service.events.stays import times_in_zones
from support.events import EventBench, S, circle


def seconds(bench: EventBench, tag: str = "a", zone: str = "dock", from_ns: int = 0) -> float:
    """Return the time until now, if the tag's place is known until now."""
    now_ns = bench.poses.now_ns
    times = times_in_zones(bench.database, from_ns, now_ns, {tag: now_ns})
    return times[tag, zone].inside_ns / S if (tag, zone) in times else 0.0


def test_time_counts_from_entry_to_exit_also_without_events() -> None:
    bench = EventBench()
    bench.put(circle(enter=False, exit=False))
    began_ns = bench.poses.now_ns
    bench.stay(10.0, "a", x=0.0)
    assert seconds(bench) == pytest.approx(10, abs=0.3)  # it is still inside
    assert bench.stay(10.0, "a", x=30.0) == []
    assert seconds(bench) == pytest.approx(10, abs=0.3)
    assert seconds(bench, from_ns=began_ns + 4 * S) == pytest.approx(6, abs=0.3)  # it was inside already
    assert seconds(bench, from_ns=began_ns + 11 * S) == 0
    bench.stay(5.0, "a", x=0.0)
    assert seconds(bench) == pytest.approx(15, abs=0.5)
    times = times_in_zones(bench.database, 0, bench.poses.now_ns, {})
    assert times["a", "dock"].stays == 1  # nothing is known of the tag now, so the second stay has no time


def test_a_tag_that_was_lost_counts_only_if_it_was_inside_before_and_after() -> None:
    bench = EventBench()
    bench.put(circle())
    bench.stay(10.0, "a", x=0.0)
    bench.stay(60.0)
    bench.stay(10.0, "a", x=0.0)
    assert seconds(bench) == pytest.approx(80, abs=0.3)
    bench.stay(60.0, "a", x=0.0, state=State.LOST)
    assert bench.stay(3.0, "a", x=30.0) == ["zone.exit a"]
    assert seconds(bench) == pytest.approx(80, abs=0.3)


def test_a_deleted_tag_a_deleted_zone_and_an_unconcerned_tag_end_their_stay() -> None:
    bench = EventBench()
    answers = bench.poses.answers
    bench.put(circle(), circle("yard", radius_m=50.0), circle("gate", tags=["a"]))
    bench.stay(10.0, "a", "b", x=0.0)
    bench.items.zones.remove("yard")
    answers.tags.delete(answers.tags.register("b").row)
    bench.put(circle("gate", tags=["other"]), circle(radius_m=8.0))
    bench.stay(5.0, "a", x=0.0)
    assert seconds(bench, zone="dock") == pytest.approx(15, abs=0.3)  # drawn again around it
    for tag, zone in (("a", "yard"), ("b", "dock"), ("b", "yard"), ("a", "gate")):
        assert seconds(bench, tag, zone) == pytest.approx(10, abs=0.3), (tag, zone)
    assert [*bench.store.occupants()] == ["dock"]


def test_a_tag_that_leaves_the_group_of_a_zone_while_the_service_is_off_is_not_inside() -> None:
    bench = EventBench()
    bench.poses.answers.site.set_tag("a", TagSettings(group="carts"))
    bench.put(circle(groups=["carts"]))
    bench.stay(10.0, "a", x=0.0)
    bench.poses.answers.site.set_tag("a", TagSettings(group="forklifts"))
    bench.start()
    bench.stay(1.0)
    assert bench.store.occupants() == {}


def test_stays_go_on_after_a_restart_and_end_with_their_retention(tmp_path: Path) -> None:
    bench = EventBench(tmp_path)
    bench.put(circle())
    bench.stay(10.0, "a", x=0.0)
    bench.start()
    bench.stay(10.0, "a", x=0.0)
    bench.stay(5.0, "a", x=30.0)
    assert seconds(bench) == pytest.approx(20, abs=0.3)
    bench.store.prune(bench.poses.now_ns - 6 * S, 2**40)
    assert seconds(bench) == pytest.approx(20, abs=0.3)
    bench.store.prune(bench.poses.now_ns - 4 * S, 2**40)
    assert seconds(bench) == 0
    bench.store.commit([], {}, [Stay("a", "dock", 1 * S, 4 * S)])
    bench.store.prune(0, 1)  # the file is too large
    assert seconds(bench) == 0
