"""Events and the states behind them are stored together, and go on after a kill or a full disk."""

import sqlite3
from pathlib import Path

import pytest

from dropanchor_schemas.zones import BatteryLowRule, EventType, TooCloseRule
from dropanchor_service.events.database import FILE_NAME, VERSION, Database, EventFileError
from dropanchor_service.events.deliveries import Deliveries
from dropanchor_service.events.drafts import Draft
from dropanchor_service.events.store import EventStore, Selection
from support.events import EventBench, S, circle, make_older


def draft(tag: str, t_ns: int = S, **data: object) -> Draft:
    return Draft(EventType.ZONE_ENTER, tag, {"t_ns": t_ns, "since_ns": t_ns, **data})


def test_a_restart_repeats_no_event_and_forgets_no_tag_inside(tmp_path: Path) -> None:
    bench = EventBench(tmp_path)
    bench.put(
        circle(dwell_s=5.0),
        rules=[
            BatteryLowRule(id="battery", type="battery_low"),
            TooCloseRule(id="apart", type="too_close", distance_m=2.0),
        ],
    )
    bench.stay(1.0, "a", "b", x=0.0)
    bench.health.record(0, {"battery_fraction": 0.1}, 1)
    first = bench.stay(20.0, "a", "b", x=0.0)
    assert sorted(first) == sorted(
        ["zone.enter a", "zone.enter b", "zone.dwell a", "zone.dwell b", "tags.too_close a", "tag.battery_low a"]
    )
    bench.start()  # nothing in memory is left, as after a kill
    assert bench.stay(20.0, "a", "b", x=0.0) == []
    assert bench.stay(3.0, "a", x=30.0) == ["zone.exit a"]


def test_a_tag_that_registers_later_goes_on_from_its_stored_state(tmp_path: Path) -> None:
    bench = EventBench(tmp_path)
    bench.put(circle())
    bench.stay(2.0, "a", x=0.0)
    later = EventBench(tmp_path)
    assert later.stay(3.0, "b", x=30.0) == []
    assert later.stay(3.0, "a", x=0.0) == []
    assert later.stay(3.0, "a", x=30.0) == ["zone.exit a"]


def test_events_wait_for_a_disk_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = EventBench(tmp_path)
    bench.put(circle())

    def fail(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patched:
        patched.setattr(bench.store, "commit", fail)
        assert bench.stay(3.0, "a", x=0.0) == []
        assert bench.thread.problems == {0: "events cannot be stored: database or disk is full"}
        assert bench.stay(3.0, "a", x=30.0) == []
    assert bench.stay(0.2, "a", x=30.0) == ["zone.enter a", "zone.exit a"]
    assert bench.thread.problems == {}


def test_a_failed_transaction_leaves_nothing_behind(tmp_path: Path) -> None:
    database = Database(tmp_path)
    store = EventStore(database, "yard", lambda draft: ["hook", "hook"] if draft.tag == "bad" else ["hook"])
    store.commit([draft("good")], {})
    with pytest.raises(sqlite3.IntegrityError):
        store.commit([draft("fine"), draft("bad")], {})
    assert len(store.after(0, 10)) == 1
    assert Deliveries(database).states()["hook"][:2] == (1, 0)
    store.commit([draft("later")], {})
    assert [event.sequence for event in store.after(0, 10)] == [1, 2]


def test_old_and_too_many_events_are_deleted_with_their_deliveries(tmp_path: Path) -> None:
    database = Database(tmp_path)
    store = EventStore(database, "yard", lambda _: ["hook"])
    store.commit([draft("a", t_ns=number * S) for number in range(10)], {})
    assert store.prune(keep_from_ns=4 * S, max_bytes=2**40) == 4
    assert store.prune(keep_from_ns=4 * S, max_bytes=2**40) == 0
    assert (store.after(0, 10)[0].sequence, store.dropped_deliveries) == (5, 4)
    assert store.prune(keep_from_ns=0, max_bytes=1) == 6
    assert store.after(0, 10) == []
    store.commit([draft("a")], {})
    assert store.newest == 11


def test_events_are_selected_by_tag_type_zone_and_time() -> None:
    store = EventStore(Database(None), "yard")
    store.commit([draft("a", 1, zone="x"), draft("b", 2, zone="y"), draft("a", 3, zone="y")], {})

    def found(**selection: object) -> list[int]:
        return [event.sequence for event in store.after(0, 10, Selection(**selection))]  # type: ignore[arg-type]

    assert found() == [1, 2, 3]
    assert found(tags=["a"]) == [1, 3]
    assert found(zones=["y"], tags=["a"]) == [3]
    assert found(since_ns=2) == [2, 3]
    assert found(types=[EventType.TAG_LOST.value]) == []
    assert [event.sequence for event in store.last(2)] == [2, 3]


def test_a_damaged_file_is_moved_aside_and_another_version_is_refused(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_bytes(b"no database" * 100)
    Database(tmp_path).close()
    assert len(list(tmp_path.glob(f"{FILE_NAME}.damaged-*"))) == 1
    with sqlite3.connect(tmp_path / FILE_NAME) as connection:
        connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(EventFileError, match=f"schema 99, and this version knows {VERSION}"):
        Database(tmp_path)


def test_the_queues_of_an_older_file_go_on(tmp_path: Path) -> None:
    bench = EventBench(tmp_path, addressees=["hook"])
    bench.store.commit([draft("a")], {})
    make_older(bench.database, 4)
    database = Database(tmp_path)
    assert Deliveries(database).states()["hook"].pending == 1
    assert Deliveries(database).next_chance("hook") is None
    assert database.rows("PRAGMA user_version") == [(VERSION,)]
    database.close()


def test_a_storm_of_ten_thousand_tags_is_stored_complete_and_in_order(tmp_path: Path) -> None:
    bench = EventBench(tmp_path, addressees=["hook"])
    bench.put(circle())
    tags = [f"tag-{number}" for number in range(10_000)]
    bench.stay(0.2, *tags, x=30.0)
    assert len(bench.stay(2.0, *tags, x=0.0)) == 10_000
    assert {event.subject for event in bench.events()} == set(tags)
    assert Deliveries(bench.database).states()["hook"][:2] == (10_000, 0)
    assert bench.stay(2.0, *tags, x=0.0) == []
