"""Ring buffers keep the last records of every row; the pose history decimates poses."""

import numpy as np
import pytest

from dropanchor_service.estimation.columns import POSE
from dropanchor_service.store.pose_history import SPACING_NS, PoseHistory
from dropanchor_service.store.rings import FEW, RowRings, rank_in_row

RECORD = np.dtype([("row", "i4"), ("value", "i8")])


def records(*pairs: tuple[int, int]) -> np.ndarray:
    return np.array(list(pairs), RECORD)


def test_a_row_keeps_its_last_records_in_order_whatever_other_rows_do() -> None:
    rings = RowRings(RECORD, 3, 10_000)
    rings.write(records((0, 1), (2, 10), (0, 2), (2, 11)))
    rings.write(records((0, 3), (0, 4), (2, 12)))
    assert rings.of(0)["value"].tolist() == [2, 3, 4]
    assert rings.of(2)["value"].tolist() == [10, 11, 12]
    assert rings.of(1)["value"].tolist() == rings.of(99)["value"].tolist() == []


def test_one_batch_may_hold_more_records_than_a_ring() -> None:
    rings = RowRings(RECORD, 4, 10_000)
    rings.write(records(*((0, value) for value in range(11))))
    assert rings.of(0)["value"].tolist() == [7, 8, 9, 10]


def test_with_more_rows_each_row_keeps_fewer_records_and_loses_only_the_oldest() -> None:
    rings = RowRings(RECORD, 8, 8 * 8 * RECORD.itemsize)
    rings.write(records(*((0, value) for value in range(10)), (1, 5)))
    assert len(rings.of(0)) == 8
    rings.write(records((20, 1)))
    assert rings.of(0)["value"].tolist() == [7, 8, 9]
    assert rings.of(1)["value"].tolist() == [5]
    rings.write(records((0, 10), (1, 6)))
    assert rings.of(0)["value"].tolist() == [8, 9, 10]
    assert rings.of(1)["value"].tolist() == [5, 6]


@pytest.mark.parametrize("count", [0, 1, FEW, 4 * FEW])
def test_ranks_of_few_entries_and_of_many_follow_one_rule(count: int) -> None:
    rows = np.random.default_rng(count).integers(0, 9, count)
    expected = [rows[:index].tolist().count(row) for index, row in enumerate(rows.tolist())]
    assert rank_in_row(rows).tolist() == expected
    assert rank_in_row(np.sort(rows)).tolist() == [number for row in range(9) for number in range((rows == row).sum())]


def poses(*times_ns: int, row: int = 0) -> np.ndarray:
    made = np.zeros(len(times_ns), POSE)
    made["row"], made["t_ns"] = row, times_ns
    return made


def test_a_history_keeps_one_pose_per_quarter_of_a_second_however_they_arrive() -> None:
    times = [100_000_000 * i for i in range(11)]
    at_once, one_by_one = PoseHistory(), PoseHistory()
    at_once.write(np.concatenate([poses(*times), poses(*times, row=3)]))
    for t_ns in times:
        one_by_one.write(poses(t_ns))
    expected = [0, 300_000_000, 500_000_000, 800_000_000, 1_000_000_000]
    assert at_once.of(0)["t_ns"].tolist() == at_once.of(3)["t_ns"].tolist() == expected
    assert one_by_one.of(0)["t_ns"].tolist() == expected


def test_after_a_clock_was_set_back_the_history_holds_only_newer_poses() -> None:
    history = PoseHistory()
    history.write(poses(*(SPACING_NS * i for i in (10, 11, 12, 2, 3))))
    assert history.of(0)["t_ns"].tolist() == [SPACING_NS * 2, SPACING_NS * 3]


def test_numbers_are_kept_with_seven_digits_or_with_all() -> None:
    dtype = np.dtype([("row", "i4"), ("t_ns", "i8"), ("x", "f8"), ("speed", "f8"), ("cov", "f8", (2, 2))])
    record = np.zeros(1, dtype)
    record["t_ns"], record["x"], record["speed"], record["cov"] = 2**60 + 1, 1 / 3, 1 / 3, 1 / 3
    rings = RowRings(dtype, max_depth=4, max_bytes=2**20, wide=("x",))

    rings.write(record)
    kept = rings.of(0)

    assert kept.dtype == dtype
    assert (kept["t_ns"][0], kept["x"][0]) == (2**60 + 1, 1 / 3)
    assert kept["speed"][0] == np.float32(1 / 3)
    assert (kept["cov"] == np.float32(1 / 3)).all()
