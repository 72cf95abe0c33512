"""Error propagation of the three-point speed."""

import pytest

from dropanchor_evaluation.paper.error_propagation import (
    Case,
    corrected_std,
    paper_std,
    sampled,
    unequal_intervals,
)


@pytest.mark.parametrize("case", [Case(10.0, 2.0, 1.0, 0.01), Case(10.0, 2.0, 2.0, 0.05), Case(100.0, 10.0, 2.0, 0.2)])
def test_the_monte_carlo_decides_for_the_corrected_formula(case: Case) -> None:
    found = sampled(case, draws=200_000, seed=3).std
    assert found == pytest.approx(corrected_std(case), rel=0.03)
    assert abs(found - paper_std(case)) > 0.5 * found


def test_longer_intervals_make_the_error_smaller_and_not_larger() -> None:
    short, long = Case(50.0, 2.0, 3.0, 0.05), Case(50.0, 2.0, 6.0, 0.05)
    assert sampled(long, 50_000, 1).std < sampled(short, 50_000, 1).std
    assert corrected_std(long) < corrected_std(short)
    assert paper_std(long) > 1.5 * corrected_std(long)


def test_the_printed_denominator_is_wrong_for_unequal_intervals_and_right_for_equal_ones() -> None:
    printed, corrected = unequal_intervals((0.0, 0.4, 1.5), 2.0, 10.0)
    assert corrected == pytest.approx(2.0)
    assert printed == pytest.approx(3.32, abs=0.01)
    assert unequal_intervals((0.0, 0.5, 1.0), 2.0, 10.0) == pytest.approx((2.0, 2.0))


def test_noise_as_large_as_the_second_difference_biases_the_root_and_makes_it_imaginary() -> None:
    found = sampled(Case(10.0, 2.0, 1.0, 0.2), draws=100_000, seed=2)
    assert found.bias > 0.1
    assert 0.15 < found.negative < 0.3
