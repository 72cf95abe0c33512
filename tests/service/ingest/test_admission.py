"""Which tags are admitted: listed and unknown ones, too many of them, and those that wait."""

from pathlib import Path

import pytest

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.site import TagSettings
from dropanchor_service.ingest.buffer import UNREGISTERED_PER_TURN
from service.ingest.messages import S, T, ranges
from support.ingest import IngestBench
from support.manual_clock import ManualClock


def take_turns(bench: IngestBench) -> None:
    while bench.buffer.depth:
        bench.ingest.turn()


def fused(bench: IngestBench) -> list[float]:
    return [value for batch in bench.engine.batches for value in batch.ranges["range"].tolist()]


def test_unknown_tags_are_rejected_if_the_settings_say_so_and_listed_ones_are_not() -> None:
    bench = IngestBench(unknown_tags="refuse", tags={"listed": {}})
    bench.send("listed", ranges(1.0))
    bench.send("unlisted", ranges(2.0))
    assert bench.rejected() == {"tag_unknown": 1}
    assert bench.x_of(["listed", "unlisted"]) == [1.0, None]
    bench.site.set_tag("unlisted", TagSettings())
    bench.send("unlisted", ranges(3.0))
    assert bench.x_of(["unlisted"]) == [3.0]


def test_no_more_tags_than_max_tags_are_registered() -> None:
    bench = IngestBench(max_tags=2)
    for name in "abcd":
        bench.send(name, ranges(1.0))
    assert [tag.name for tag in bench.tags.all()] == ["a", "b"]
    assert bench.rejected() == {"tags_full": 2}


def test_a_flood_of_unknown_tags_is_bounded_and_does_not_harm_registered_tags() -> None:
    bench = IngestBench(max_tags=10)
    bench.send("known", ranges(1.0))
    for number in range(50_000):
        bench.put(f"unlisted{number}", ranges(1.0))
    bench.send("known", ranges(2.0))
    assert bench.x_of(["known"]) == [2.0]
    take_turns(bench)
    assert len(bench.tags) == 10
    rejected = bench.rejected()
    assert rejected["shed"] > 0
    assert rejected["shed"] + rejected["tags_full"] == 50_000 - 9


def test_a_tag_gets_its_row_with_its_second_message_if_many_are_new_and_loses_none() -> None:
    bench = IngestBench(max_unconfirmed_tags=1)
    bench.send("quick", ranges(1.0))
    bench.put("slow", ranges(2.0, sequence=0, boot_id=5), at_ns=T)
    bench.ingest.turn()
    assert [tag.name for tag in bench.tags.all()] == ["quick"]
    assert len(bench.pending_tags) == 1
    bench.put("slow", ranges(3.0, sequence=1, boot_id=5), at_ns=T + S)
    bench.ingest.turn()
    assert [tag.name for tag in bench.tags.all()] == ["quick", "slow"]
    assert fused(bench) == [1.0, 2.0, 3.0]
    assert len(bench.pending_tags) == 0
    assert bench.rejected() == {}


def test_a_duplicated_or_unreadable_message_does_not_confirm_a_tag() -> None:
    bench = IngestBench(max_unconfirmed_tags=0)
    for _ in range(3):
        bench.put("doubled", ranges(1.0), at_ns=T)
    for second in range(3):
        bench.put("junk", b"junk", at_ns=T + second * S)
    bench.ingest.turn()
    assert len(bench.tags) == 0
    assert bench.rejected() == {"version_unknown": 3}
    assert [pending.name for pending in bench.pending_tags.all()] == ["doubled"]


def test_confirmed_tags_make_room_for_other_unlisted_ones() -> None:
    bench = IngestBench(max_unconfirmed_tags=1)
    bench.put("first", ranges(1.0), at_ns=T)
    bench.put("waits", ranges(2.0), at_ns=T)
    bench.ingest.turn()
    bench.put("first", ranges(3.0), at_ns=T + S)
    bench.ingest.turn()
    bench.put("at-once", ranges(4.0), at_ns=T + S)
    bench.ingest.turn()
    assert [tag.name for tag in bench.tags.all()] == ["first", "at-once"]


def test_tags_that_send_once_are_dropped_and_all_of_their_messages_are_counted() -> None:
    bench = IngestBench(max_tags=100, max_unconfirmed_tags=10)
    for number in range(5_000):
        bench.put(f"unlisted{number}", ranges(1.0))
        if number % 200 == 0:
            bench.ingest.turn()
    take_turns(bench)
    bench.ingest.turn()
    assert len(bench.tags) == 10
    assert len(bench.pending_tags) == 100
    assert bench.rejected() == {"tag_unconfirmed": 5_000 - 10 - 100}


def test_a_quarantined_tag_is_pending_until_its_settings_are_put() -> None:
    bench = IngestBench(unknown_tags="quarantine", tags={"listed": {}})
    bench.send("listed", ranges(1.0))
    for value in (2.0, 3.0):
        bench.send("unlisted", ranges(value))
    assert fused(bench) == [1.0]
    assert [(pending.name, pending.messages) for pending in bench.pending_tags.all()] == [("unlisted", 2)]
    assert bench.rejected() == {"tag_quarantined": 2}
    bench.site.set_tag("unlisted", TagSettings())
    bench.send("unlisted", ranges(4.0))
    assert fused(bench) == [1.0, 4.0]
    assert len(bench.pending_tags) == 0


@pytest.mark.parametrize(
    ("unknown_tags", "reason", "pending"), [("quarantine", "tag_quarantined", 1), ("refuse", "tag_unknown", 0)]
)
def test_a_deleted_tag_that_still_sends_needs_to_be_admitted_again(
    unknown_tags: str, reason: str, pending: int
) -> None:
    bench = IngestBench(unknown_tags=unknown_tags, tags={"a": {}})
    bench.send("a", ranges(1.0))
    [tag] = bench.tags.all()
    bench.put("a", ranges(2.0))  # in the buffer while the tag is deleted
    bench.site.remove_tag("a", T)
    bench.tags.delete(tag.row)
    bench.latest.forget(tag.row)
    bench.ingest.turn()
    bench.send("a", ranges(3.0))
    assert (fused(bench), bench.tags.listed(), bench.x_of(["a"])) == ([1.0], [], [None])
    assert bench.rejected() == {reason: 2}
    assert len(bench.pending_tags) == pending
    bench.site.set_tag("a", TagSettings())
    bench.send("a", ranges(4.0))
    assert (fused(bench), bench.tags.listed(), bench.x_of(["a"])) == ([1.0, 4.0], [tag], [4.0])
    assert len(bench.pending_tags) == 0


def test_samples_that_were_pending_when_their_tag_was_deleted_make_no_pose() -> None:
    clock = ManualClock(T)
    bench = IngestBench(unknown_tags="quarantine", tags={"a": {}}, clock=clock)
    bench.send("a", ranges(1.0, sequence=1, boot_id=1), ranges(3.0, sequence=3, boot_id=1))
    bench.tags.delete(0)
    bench.latest.forget(0)
    clock.t_ns += S
    bench.ingest.turn()
    assert fused(bench) == [1.0, 3.0]
    assert bench.x_of(["a"]) == [None]


def test_messages_kept_for_a_tag_are_used_when_rest_registers_it() -> None:
    bench = IngestBench(max_unconfirmed_tags=0)
    bench.put("a", ranges(1.0), at_ns=T)
    bench.ingest.turn()
    bench.tags.register("a")  # as REST does
    bench.ingest.turn()
    assert fused(bench) == [1.0]


def test_messages_of_listed_tags_do_not_wait_among_those_of_unregistered_ones() -> None:
    names = [f"listed-{number}" for number in range(UNREGISTERED_PER_TURN + 500)]
    bench = IngestBench(tags={name: {} for name in names})
    bench.ingest.turn()
    for name in names:
        bench.put(name, ranges(1.0))
    while bench.buffer.depth:
        bench.ingest.turn()
    assert bench.rejected() == {}
    assert bench.x_of(names) == [1.0] * len(names)


def test_listed_and_announced_tags_have_a_row_before_their_first_message(tmp_path: Path) -> None:
    bench = IngestBench(tmp_path, tags={"listed": {}})
    bench.ingest.announce(samples_key("default", "alive"))
    bench.ingest.turn()
    assert [tag.name for tag in bench.tags.all()] == ["listed", "alive"]
