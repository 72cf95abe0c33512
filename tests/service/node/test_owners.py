"""What a node knows about the owners of the buckets."""

import asyncio

from dropanchor_service.node.owners import HOLD_S, Owner, Owners
from support.manual_clock import ManualClock

FIRST, SECOND = Owner("017", 4, "a", "http://a"), Owner("017", 5, "b", "http://b")


def test_an_older_table_does_not_bring_a_former_owner_back() -> None:
    owners = Owners()
    owners.take([SECOND, Owner("018", 1, "c", "")])
    owners.take([FIRST, Owner("018", 1, "c", "")])
    assert owners.of("017") == SECOND
    assert owners.without_owner() == ["018"]
    owners.take([SECOND])
    assert owners.buckets == ["017"]


def test_a_higher_epoch_in_the_table_or_in_an_answer_ends_what_waits_for_the_former_owner() -> None:
    async def ended() -> list[bool]:
        by_table, by_answer = Owners(), Owners()
        for owners in (by_table, by_answer):
            owners.take([FIRST])
        futures = [owners.followed(FIRST) for owners in (by_table, by_answer)]
        assert not any(future.done() for future in futures)
        by_table.take([SECOND])
        assert by_answer.accepted(FIRST, 5) == by_answer.of("017") == Owner("017", 5, "a", "http://a")
        assert by_answer.accepted(FIRST, 4) is None
        return [future.done() for future in (*futures, by_table.followed(FIRST))]

    assert asyncio.run(ended()) == [True, True, True]


def test_requests_wait_for_a_successor_only_shortly_after_the_bucket_was_served_or_moved() -> None:
    clock = ManualClock(0)
    owners = Owners(lambda: clock.t_ns * 1e-9)
    owners.take([FIRST])
    assert not owners.is_worth_waiting("017")
    for follows in (False, True):
        if follows:
            owners.take([SECOND])
        else:
            owners.accepted(FIRST, 4)
        assert owners.is_worth_waiting("017")
        clock.t_ns += round(HOLD_S * 1e9)
        assert not owners.is_worth_waiting("017")
