"""A tag that falls silent while it is online is returned once per silence."""

import numpy as np

from dropanchor_service.store import TagTable
from dropanchor_service.zenoh_io.silent_tags import SilentTags

S = 1_000_000_000


def heard(tags: TagTable, name: str, now_ns: int) -> None:
    tags.rows.count_messages(np.array([tags.register(name).row], np.int32), now_ns)


def fleet(*names: str) -> tuple[TagTable, SilentTags]:
    tags = TagTable()
    for name in names:
        tags.presence.set_token(name, True)
    return tags, SilentTags(tags.rows)


def taken(silent: SilentTags, now_ns: int, limit: int = 10) -> list[int]:
    """Return what the second of two looks finds."""
    silent.take(now_ns - S // 2, limit)
    return silent.take(now_ns, limit)


def test_a_tag_is_returned_once_when_it_falls_silent_and_again_after_its_next_message() -> None:
    tags, silent = fleet("a")
    heard(tags, "a", 10 * S)
    assert taken(silent, 10 * S + S // 2) == []
    assert taken(silent, 12 * S) == [0]
    assert taken(silent, 13 * S) == []
    heard(tags, "a", 20 * S)
    assert taken(silent, 22 * S) == [0]


def test_a_tag_whose_messages_wait_while_the_process_stands_still_is_not_silent() -> None:
    tags, silent = fleet("a")
    for stall in range(3):
        heard(tags, "a", (10 + 5 * stall) * S)
        assert silent.take((14 + 5 * stall) * S, 10) == []


def test_a_tag_that_nobody_knew_about_is_returned_again() -> None:
    tags, silent = fleet("a")
    heard(tags, "a", 10 * S)
    assert taken(silent, 12 * S) == [0]
    silent.return_again(0)
    assert silent.take(13 * S, 10) == [0]
    assert silent.take(14 * S, 10) == []


def test_what_an_earlier_process_heard_and_tags_that_are_offline_are_not_returned() -> None:
    tags, _ = fleet("a", "b")
    heard(tags, "a", 10 * S)
    silent = SilentTags(tags.rows)
    heard(tags, "b", 10 * S)
    tags.presence.set_token("b", False)
    assert taken(silent, 20 * S) == []


def test_those_that_are_silent_for_longest_come_first_and_the_others_later() -> None:
    names = [f"t{i}" for i in range(40)]
    tags, silent = fleet(*names)
    for i, name in enumerate(reversed(names)):
        heard(tags, name, (100 + i) * S)
    assert taken(silent, 200 * S, 20) == list(range(20))
    assert silent.take(200 * S, 100) == list(range(20, 40))
