"""An alarm begins with an event, lasts as long as what it is about, and ends with another event; nothing loses it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from dropanchor_schemas.alarms import Acknowledgement
from dropanchor_schemas.audit import Author
from dropanchor_schemas.destinations import EmailDestination, MqttDestination
from dropanchor_schemas.zones import EventRule, EventType, LostRule, Severity, TooCloseRule, Zone
from dropanchor_service.delivery.registry import addressees, open_destinations
from dropanchor_service.delivery.sentences import sentence
from dropanchor_service.delivery.words import words_in
from dropanchor_service.estimation.columns import State
from dropanchor_service.events.alarms import CURRENT
from support.events import EventBench, S, circle, make_older

ALARM = Severity.ALARM
LOST = LostRule(id="lost", type="lost", after_s=1.0, severity=ALARM)
CLOSE = TooCloseRule(id="apart", type="too_close", distance_m=2.0, severity=Severity.WARNING)


def lost(bench: EventBench) -> list[str]:
    return bench.stay(4.0, "a", state=State.LOST)


@pytest.mark.parametrize(
    ("item", "begin", "begins", "end", "ends"),
    [
        (circle(enter=False, enter_severity=ALARM), {"x": 0.0}, "zone.enter", {"x": 30.0}, ["zone.exit a"]),
        (circle(enter=False, dwell_s=2, dwell_severity=ALARM), {"x": 0.0}, "zone.dwell", {"x": 30.0}, ["zone.exit a"]),
        (
            circle(enter=False, speed_mps=2, speed_severity=ALARM),
            *({"x": 0.0, "speed": 3.0}, "zone.speed", {"x": 0.0, "speed": 1.0}, []),
        ),
        (LOST, {"state": State.LOST}, "tag.lost", {"x": 0.0}, []),
    ],
    ids=["entering", "staying", "speeding", "lost"],
)
def test_an_alarm_lasts_as_long_as_what_it_is_about_also_through_a_restart(
    tmp_path: Path, item: Zone | EventRule, begin: dict[str, float], begins: str, end: dict[str, float], ends: list[str]
) -> None:
    bench = EventBench(tmp_path)
    zones, rules = ([item], []) if isinstance(item, Zone) else ([], [item])
    bench.put(*zones, rules=rules)
    assert bench.stay(5.0, "a", **begin) == [f"{begins} a"]
    (began,) = bench.events()
    (alarm,) = bench.alarms()
    assert (alarm.id, alarm.severity, began.data.severity, alarm.acknowledged) == (began.id, "alarm", ALARM, None)
    bench.start()  # nothing in memory is left, as after a kill
    assert bench.stay(5.0, "a", **begin) == []
    assert bench.alarms() == [alarm]
    assert bench.stay(5.0, "a", **end) == ["alarm.over a", *ends]
    over = bench.events()[1]
    assert (over.data.alarm, over.data.alarm_type, over.data.since_ns) == (began.id, began.type, began.data.since_ns)
    assert (over.data.zone, over.data.rule, over.data.severity) == (began.data.zone, began.data.rule, ALARM)
    assert bench.alarms() == []
    assert [one.over_ns for one in bench.alarms(CURRENT)] == [over.data.t_ns]  # until somebody acknowledges it


def delete_tag(bench: EventBench) -> None:
    tags = bench.poses.answers.tags
    tags.delete(tags.register("a").row)


@pytest.mark.parametrize(
    "stop",
    [
        lambda bench: bench.items.rules.remove("lost"),
        lambda bench: bench.put(rules=[LOST.model_copy(update={"severity": Severity.EVENT})]),
        delete_tag,
    ],
    ids=["rule deleted", "severity lowered", "tag deleted"],
)
def test_an_alarm_that_nobody_watches_any_longer_is_over(stop: Callable[[EventBench], None]) -> None:
    bench = EventBench()
    bench.put(rules=[LOST])
    assert lost(bench) == ["tag.lost a"]
    stop(bench)
    assert bench.stay(0.2) == ["alarm.over a"]
    assert bench.alarms() == []


def test_two_tags_have_one_alarm_for_each_time_that_they_come_too_close() -> None:
    bench = EventBench()
    bench.put(rules=[CLOSE])

    def stay(x: float) -> list[str]:
        found = []
        for _ in range(20):
            bench.poses.move("a", x=0.0)
            found += bench.stay(0.2, "b", x=x)
        return found

    begins = ["tags.too_close a"]
    assert stay(1.0) + stay(50.0) == [*begins, "alarm.over a"]
    assert stay(1.0) == begins
    found = bench.alarms(CURRENT)
    assert [(one.severity, one.over_ns is None) for one in found] == [("warning", True), ("warning", False)]


def test_who_acknowledges_is_kept_and_told_and_the_alarm_goes_on(tmp_path: Path) -> None:
    bench = EventBench(tmp_path)
    bench.put(rules=[LOST])
    lost(bench)
    (alarm,) = bench.alarms()
    said = Acknowledgement(by=Author(source="key", name="anna"), t_ns=bench.poses.now_ns, note="is charging")
    bench.store.acknowledge(alarm.id, said)
    with pytest.raises(KeyError):
        bench.store.acknowledge("another", said)
    bench.start()
    assert bench.stay(2.0, "a", state=State.LOST) == []
    (known,) = bench.alarms()
    assert Acknowledgement.model_validate_json(known.acknowledged or "") == said
    told = bench.events()[-1]
    assert (told.type, told.data.acknowledged_by, told.data.note) == (
        EventType.ALARM_ACKNOWLEDGED,
        "anna",
        "is charging",
    )
    assert sentence(told, str, words_in(EmailDestination.model_fields["language"].default)) == (
        "Acknowledged for a: Tag lost (lost) (anna) is charging"
    )
    assert bench.stay(1.0, "a", x=0.0) == ["alarm.over a"]
    assert bench.alarms(CURRENT) == []


def test_whoever_got_the_beginning_gets_the_end_and_a_muted_rule_writes_no_mails() -> None:
    destinations = open_destinations(None)
    destinations.put("mqtt", MqttDestination(id="mqtt", type="mqtt", types=[EventType.TAG_LOST]))
    destinations.put("mail", EmailDestination(id="mail", type="email", to=["shift@example.com"]))
    bench = EventBench()
    told: list[tuple[str, list[str]]] = []

    def note(draft: object) -> list[str]:
        found = [*addressees(destinations, draft)]  # type: ignore[arg-type]
        told.append((draft.type.value.removeprefix("dropanchor."), found))  # type: ignore[attr-defined]
        return found

    bench.store._addressees = note
    bench.put(rules=[LOST])
    lost(bench)
    bench.put(rules=[LOST.model_copy(update={"muted_until_ns": bench.poses.now_ns + 7 * S})])
    bench.stay(4.0, "a", x=0.0)
    lost(bench)
    assert told == [("tag.lost", ["mqtt", "mail"]), ("alarm.over", ["mqtt"]), ("tag.lost", ["mqtt"])]
    bench.stay(4.0, "a", x=0.0)  # the rule is no longer muted
    assert told[3:] == [("alarm.over", ["mqtt", "mail"])]


def test_old_alarms_are_deleted_with_their_events_but_never_open_ones() -> None:
    bench = EventBench()
    bench.put(circle(enter_severity=ALARM), rules=[LOST])
    bench.stay(2.0, "b", x=0.0)
    bench.stay(2.0, "b", x=30.0)
    lost(bench)
    assert len(bench.alarms(CURRENT)) == 2
    bench.store.prune(keep_from_ns=bench.poses.now_ns + S, max_bytes=2**40)
    assert bench.events() == []
    (left,) = bench.alarms(CURRENT)
    assert bench.stay(1.0, "a", x=0.0) == ["alarm.over a"]
    assert bench.events()[0].data.alarm == left.id


def test_a_file_of_before_alarms_gets_them(tmp_path: Path) -> None:
    bench = EventBench(tmp_path)
    bench.put(rules=[LOST.model_copy(update={"severity": Severity.EVENT})])
    lost(bench)
    make_older(bench.database, 6)
    later = EventBench(tmp_path)
    later.put(circle(enter_severity=ALARM))
    assert later.stay(3.0, "b", x=0.0) == ["zone.enter b"]
    assert len(later.alarms()) == 1
