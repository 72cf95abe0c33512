"""The observability of range and heading."""

import pytest
import sympy as sp

from dropanchor_evaluation.paper.observability import conditions, rank_at, run, theta, twins, v, w, x, y


def test_the_papers_condition_is_a_moving_tag_off_the_radial_line() -> None:
    assert sp.simplify(conditions().paper ** 2 - (v * (x * sp.sin(theta) - y * sp.cos(theta))) ** 2) == 0


def test_second_order_replaces_the_speed_sensor_but_for_rest_and_circles_through_the_anchor() -> None:
    b = -x * sp.sin(theta) + y * sp.cos(theta)
    assert sp.simplify(conditions().second_order ** 2 - (v * (w * (x**2 + y**2) + 2 * v * b)) ** 2) == 0
    assert (conditions().rank_first_order, conditions().rank_second_order) == (4, 5)
    assert conditions().third_order_adds_nothing


@pytest.mark.parametrize(
    ("state", "rank"),
    [
        ((5.0, 3.0, 0.3, 1.2, 0.2), 5),
        ((5.0, 3.0, 0.3, 1.2, 0.0), 5),
        ((3.0, 3.0, 0.7853981633974483, 1.2, 0.0), 4),
        ((5.0, 3.0, 0.3, 0.0, 0.2), 4),
        ((0.0, 4.0, 0.0, 0.4, -0.2), 4),
    ],
)
def test_the_rank_at_a_state_agrees_with_the_condition(
    state: tuple[float, float, float, float, float], rank: int
) -> None:
    assert rank_at(state, order=2, speed_measured=False) == rank


def test_twins_are_metres_apart_and_have_the_same_ranges() -> None:
    for twin in twins():
        assert twin.difference < 1e-12
        assert twin.apart > 1.0


def test_the_section_carries_the_ranks() -> None:
    section = run()
    assert section.results["ranks"]["generic"] == [5, 4, 5]
    assert section.results["ranks"]["circle through the anchor"][2] == 4
