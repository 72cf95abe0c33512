"""A start that a person tells makes events once the ranges confirm it, and a wrong one retracts them."""

from pathlib import Path
from typing import Any

import pytest

from dropanchor_schemas.destinations import MqttDestination
from dropanchor_schemas.events import RetractionReason
from dropanchor_schemas.zones import EventType, TooCloseRule
from dropanchor_service.delivery.registry import addressees, open_destinations
from dropanchor_service.events.drafts import Draft
from dropanchor_service.events.stays import times_in_zones
from dropanchor_service.store.starts import StartNews, StartPhase
from support.api import make_api_bench
from support.events import EventBench, S, circle

RIGHT, WRONG, OTHER = "at the gate", "in the dock", "on the ramp"


def tell(bench: EventBench, phase: StartPhase, place: str = "", before: str = "", tag: str = "a") -> None:
    tags = bench.poses.answers.tags
    tags.rows.start_news.append(StartNews(tags.register(tag).row, phase, place, before))


def wrongly_inside(folder: Path | None = None) -> EventBench:
    """Return a bench with a tag that was in the yard, was said to be in the dock, and was confirmed there."""
    bench = EventBench(folder)
    bench.put(circle(), circle("yard", x=40.0))
    assert bench.stay(10.0, "a", x=40.0) == ["zone.enter a"]
    tell(bench, StartPhase.TOLD, WRONG)
    assert bench.stay(5.0, "a", x=0.0) == []
    tell(bench, StartPhase.CONFIRMED)
    assert bench.stay(5.0, "a", x=0.0) == ["zone.enter a", "zone.exit a"]
    return bench


def test_a_start_that_ranges_deny_retracts_its_events_and_gives_back_its_times(tmp_path: Path) -> None:
    bench = wrongly_inside(tmp_path)
    began_ns = bench.poses.now_ns - 20 * S
    bench.start()  # as after a kill: what is stored is enough
    tell(bench, StartPhase.RESUMED, WRONG)
    assert bench.stay(1.0, "a", x=0.0) == []
    tell(bench, StartPhase.DENIED)
    assert bench.stay(0.2) == ["event.retracted a", "event.retracted a"]
    _, entered, left, *retractions = bench.events()
    assert [one.data.retracts for one in retractions] == [entered.id, left.id]
    assert [one.data.retracted_type for one in retractions] == [EventType.ZONE_ENTER, EventType.ZONE_EXIT]
    assert {(one.data.reason, one.data.name or one.data.zone) for one in retractions} == {
        (RetractionReason.START_DENIED, "yard"),
        (RetractionReason.START_DENIED, "dock"),
    }
    assert [*bench.store.occupants()] == ["yard"]
    bench.stay(10.0, "a", x=40.0)
    times = times_in_zones(bench.database, began_ns, bench.poses.now_ns, {"a": bench.poses.now_ns})
    assert {zone: time.stays for (_, zone), time in times.items()} == {"yard": 1}
    assert times["a", "yard"].inside_ns == pytest.approx(bench.poses.now_ns - began_ns, abs=3 * S)
    assert bench.store.starts() == {}


@pytest.mark.parametrize(
    ("phase", "place", "reason"),
    [
        (StartPhase.TOLD, RIGHT, RetractionReason.START_TAKEN_BACK),  # the start of before: an undo
        (StartPhase.TOLD, "", RetractionReason.START_TAKEN_BACK),
        (StartPhase.TOLD, OTHER, None),  # the tag is there now
        (StartPhase.SETTLED, "", None),
        (StartPhase.ENDED, "", None),
    ],
)
def test_an_event_is_retracted_when_its_start_is_taken_back_and_not_when_the_tag_goes_on(
    phase: StartPhase, place: str, reason: RetractionReason | None
) -> None:
    bench = EventBench()
    bench.put(circle())
    tell(bench, StartPhase.TOLD, WRONG, RIGHT)
    tell(bench, StartPhase.CONFIRMED)
    assert bench.stay(3.0, "a", x=0.0) == ["zone.enter a"]
    tell(bench, phase, place, WRONG)
    assert bench.stay(1.0, "a", x=0.0) == (["event.retracted a"] if reason else [])
    assert bench.events()[-1].data.reason == reason
    tell(bench, StartPhase.DENIED)
    assert bench.stay(1.0) == []  # nothing is retracted twice, and nothing of before


def test_a_start_that_was_confirmed_before_any_pose_is_seen_takes_no_earlier_times_with_it(tmp_path: Path) -> None:
    bench = EventBench(tmp_path)
    bench.put(circle("yard", x=40.0), circle())
    began_ns = bench.poses.now_ns
    bench.stay(10.0, "a", x=40.0)
    assert bench.stay(5.0, "a", x=20.0) == ["zone.exit a"]
    bench.poses = make_api_bench()  # a restart that keeps what is stored, and no pose
    bench.poses.now_ns = began_ns + 60 * S
    bench.start()
    tell(bench, StartPhase.TOLD, WRONG)
    tell(bench, StartPhase.CONFIRMED)  # by the first batch
    bench.stay(0.2)
    assert bench.stay(5.0, "a", x=0.0) == ["zone.enter a"]
    tell(bench, StartPhase.DENIED)
    assert bench.stay(0.2) == ["event.retracted a"]
    times = times_in_zones(bench.database, began_ns, bench.poses.now_ns, {"a": bench.poses.now_ns})
    assert {zone: time.stays for (_, zone), time in times.items()} == {"yard": 1}


def test_two_tags_that_are_too_close_by_a_wrong_start_are_not(tmp_path: Path) -> None:
    bench = EventBench(tmp_path)
    bench.put(rules=[TooCloseRule(id="apart", type="too_close", distance_m=3.0)])
    tell(bench, StartPhase.TOLD, WRONG, tag="b")

    def stay() -> list[str]:
        return [event for _ in range(20) for event in bench.stay(0.2, "a", "b", x=0.0)]

    assert stay() == []
    tell(bench, StartPhase.CONFIRMED, tag="b")
    assert stay() == ["tags.too_close a"]
    tell(bench, StartPhase.DENIED, tag="b")
    tell(bench, StartPhase.TOLD, RIGHT, tag="b")
    tell(bench, StartPhase.CONFIRMED, tag="b")
    assert stay() == ["event.retracted a", "tags.too_close a"]  # now they are
    assert bench.events()[1].data.other_tag == "b"


@pytest.mark.parametrize("is_confirmed", [True, False])
def test_the_last_place_of_a_start_that_is_taken_back_makes_no_event(is_confirmed: bool) -> None:
    bench = EventBench()
    bench.put(rules=[TooCloseRule(id="apart", type="too_close", distance_m=3.0, delay_s=0.0)])
    tell(bench, StartPhase.TOLD, WRONG, tag="b")
    if is_confirmed:
        tell(bench, StartPhase.CONFIRMED, tag="b")
    made = [event for _ in range(20) for event in bench.stay(0.2, "a", "b", x=0.0)]
    assert made == (["tags.too_close a"] if is_confirmed else [])
    tell(bench, StartPhase.TOLD, "", WRONG, tag="b")
    later = [event for _ in range(10) for event in bench.stay(0.2, "a", x=0.0)]  # b has not sent since
    assert later == (["event.retracted a"] if is_confirmed else [])
    assert [event for _ in range(20) for event in bench.stay(0.2, "a", "b", x=0.0)] == ["tags.too_close a"]


def test_who_got_an_event_gets_its_retraction(tmp_path: Path) -> None:
    destinations = open_destinations(tmp_path)
    for kind in (EventType.ZONE_ENTER, EventType.ZONE_EXIT, EventType.EVENT_RETRACTED):
        one = MqttDestination(type="mqtt", id=kind.value.rpartition(".")[2], types=[kind])
        destinations.put(one.id, one)
    data: dict[str, Any] = {"retracted_type": EventType.ZONE_ENTER.value}
    assert addressees(destinations, Draft(EventType.EVENT_RETRACTED, "a", data)) == ["enter", "retracted"]
