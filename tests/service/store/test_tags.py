"""The tag table holds rows, counters and liveliness."""

import numpy as np

from dropanchor_schemas.wire import Reason
from dropanchor_service.store import TagTable


def test_a_name_keeps_its_row_and_rows_are_dense() -> None:
    tags = TagTable()
    rows = [tags.register(name).row for name in ("a", "b", "a", "c")]
    assert rows == [0, 1, 0, 2]
    assert tags.rows.at(2).name == "c"


def test_repeated_rows_are_counted_each_time() -> None:
    tags = TagTable()
    tags.register("a"), tags.register("b")
    tags.rows.count_messages(np.array([1, 1, 0]), now_ns=7)
    tags.rows.count_messages(np.array([1]), now_ns=9)
    tags.rows.count_samples("imu", np.array([1, 1, 1]))
    tags.rows.count_rejected(Reason.RANGE_NEGATIVE, np.array([0, 0]))
    tag = tags.rows.at(1)
    assert (tag.messages, tag.first_heard_ns, tag.last_heard_ns) == (3, 7, 9)
    assert tag.samples == {"imu": 3}
    assert tags.rows.at(0).rejected == {"range_negative": 2}


def test_a_batch_of_any_size_is_counted() -> None:
    tags = TagTable()
    tags.register("a"), tags.register("b")
    for count in (3, 1000):
        tags.rows.count_samples("imu", np.repeat([1, 0, 1], count))
    assert [tags.rows.at(row).samples["imu"] for row in (0, 1)] == [1003, 2006]


def test_a_tag_that_never_sent_has_no_times_and_empty_counters() -> None:
    tag = TagTable().register("a")
    assert tag.first_heard_ns is None
    assert tag.last_heard_ns is None
    assert not tag.samples
    assert not tag.rejected


def test_counters_survive_the_growth_of_the_table() -> None:
    tags = TagTable()
    first = tags.register("first")
    tags.rows.count_samples("range", np.array([0]))
    for number in range(100):
        tags.register(str(number))
    tags.rows.count_samples("range", np.array([0, 100]))
    assert first.samples == {"range": 2}
    assert tags.rows.at(100).samples == {"range": 1}


def test_a_token_seen_before_its_tag_is_remembered() -> None:
    tags = TagTable()
    tags.presence.set_token("a", True)
    assert tags.register("a").online
    tags.presence.set_token("a", False)
    assert not tags.rows.at(0).online
