"""A radio that repeats its last range."""

from itertools import cycle, islice

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.gap import is_stuck
from dropanchor_service.estimation.fleet.belief.layout import ROW
from dropanchor_service.estimation.fleet.frontend.node import NODE, RANGE


def heard(anchors: list[int], ranges: list[float], count: int = 12, rest: int = 0) -> list[bool]:
    """Return the result of `is_stuck` for ranges to these anchors in turn, every 50 ms."""
    rows: Array = np.zeros(1, ROW)
    nodes = np.zeros(count, NODE)
    nodes["t_ns"] = np.arange(count) * 50_000_000
    nodes["kind"], nodes["rest"] = RANGE, rest
    nodes["anchor"], nodes["z"] = list(islice(cycle(anchors), count)), list(islice(cycle(ranges), count))
    return [is_stuck(rows[0], node, 1.0) for node in nodes]


@pytest.mark.parametrize("anchors", [[0], [0, 1], [2, 0, 1]])
def test_a_stuck_radio_is_noticed_however_many_anchors_it_repeats(anchors: list[int]) -> None:
    said = heard(anchors, [4.0 + anchor for anchor in anchors])
    assert not any(said[: 3 * len(anchors)])
    assert all(said[3 * len(anchors) :])


def test_ranges_that_change_and_a_tag_at_rest_are_no_stuck_radio() -> None:
    assert not any(heard([0, 1], [4.0, 5.0, 4.1, 5.1]))
    assert not any(heard([0], [4.0], rest=1))


def test_two_anchors_of_one_range_are_two() -> None:
    assert not any(heard([0, 1, 2, 3], [4.0, 4.0, 4.0, 4.0], count=12))
    assert not any(heard([0, 4], [4.0, 4.0]))
