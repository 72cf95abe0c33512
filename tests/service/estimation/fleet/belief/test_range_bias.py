"""The variance of a range bias over time: it changes with the place, and is never less known than at the start."""

import math

import numpy as np
import pytest

from dropanchor_service.estimation.columns import default_settings
from dropanchor_service.estimation.fleet.belief.layout import RANGE_BIAS, ROW, N
from dropanchor_service.estimation.fleet.belief.predict import add_process_noise, fill_noise
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import STATE, node_of

TUNING = Tuning()


def std_after(seconds: float, known: float, told: float = math.nan) -> float:
    """Return the standard deviation of the bias of a tag that knew it to `known` m, this many seconds later."""
    columns, row = default_settings(), np.zeros(1, ROW)
    columns["range_bias_std"] = told
    row[:] = configure_row(columns, TUNING)
    node, decay, growth, P = node_of(), np.ones(N), np.zeros(N), np.zeros((N, N))
    P[RANGE_BIAS, RANGE_BIAS] = known * known
    for _ in range(round(seconds / node["dt_s"])):
        fill_noise(decay, growth, node, row[0], TUNING)
        add_process_noise(STATE, P, np.zeros((4, N)), growth, node, row[0], TUNING, 0)
    return math.sqrt(P[RANGE_BIAS, RANGE_BIAS])


@pytest.mark.parametrize("told", [math.nan, 0.04])
def test_a_known_bias_becomes_as_uncertain_as_at_the_start_and_no_more(told: float) -> None:
    prior = TUNING.range_bias_std if math.isnan(told) else told
    tau = TUNING.range_bias_tau
    expected = prior * math.sqrt(1.0 - math.exp(-2.0 * 5.0 / tau))
    assert std_after(5.0, 0.0, told) == pytest.approx(expected, rel=1e-6)
    assert std_after(20.0 * tau, 0.0, told) == pytest.approx(prior, rel=1e-6)


def test_a_bias_that_is_told_exactly_stays_exact() -> None:
    assert std_after(100.0, 0.0, told=0.0) == 0.0


def test_a_wider_one_as_of_a_blocked_line_of_sight_stays_as_wide() -> None:
    assert std_after(10.0, 0.5) == pytest.approx(0.5)
