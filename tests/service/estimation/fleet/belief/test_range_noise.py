"""The noise of ranges as a state: what is new in every range, and what lasts."""

from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.fleet.belief.layout import ROW, N, R
from dropanchor_service.estimation.fleet.belief.range_noise import doubt, learn_lasting, learn_white
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.frontend.node import NODE
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import hypothesis_of

T = Tuning().record()[0]
DT = 0.1


def row_of(std: float, told: bool) -> Any:
    row = np.zeros(1, ROW)[0]
    row["settings"]["range_std"], row["settings"]["range_std_given"] = std, told
    row["settings"]["mount_angle_std"], row["settings"]["range_bias_std"] = 0.5, 0.15
    return row


def range_at(t: float, z: float, reported: float = np.nan) -> Any:
    node = np.zeros(1, NODE)[0]
    node["t_ns"], node["z"], node["z_std"] = int(t * 1e9) + 1, z, reported
    return node


def learned(errors: Any, row: Any) -> Any:
    """Feed the errors of ranges of a tag that is known exactly. Return what the row learned."""
    work = make_workspace()[0]["hypotheses"]
    for k, error in enumerate(errors):
        learn_white(row, range_at(k * DT, 20.0 + 2.0 * k * DT + error), T)
        used = row["noise"]["white_var"] * row["noise"]["factor"]
        learn_lasting(work, 0, row, error, used + 1e-4, used, DT, T)
    return row["noise"]


@pytest.mark.parametrize("std", [0.3, 1.0])
def test_what_is_new_in_every_range_is_learned_whatever_the_speed(std: float) -> None:
    noise = learned(np.random.default_rng(1).normal(0.0, std, 600), row_of(0.15, told=False))
    assert np.sqrt(noise["white_var"]) == pytest.approx(std, rel=0.2)
    assert noise["factor"] < 1.5


def test_ranges_better_than_told_are_not_believed_to_be() -> None:
    noise = learned(np.random.default_rng(2).normal(0.0, 0.02, 600), row_of(0.15, told=False))
    assert np.sqrt(noise["white_var"]) == pytest.approx(0.15)
    assert noise["factor"] < 1.1


@pytest.mark.parametrize("std", [0.5, 1.0])
def test_an_error_that_lasts_is_told_from_a_new_one(std: float) -> None:
    rng, error, errors = np.random.default_rng(3), 0.0, []
    for _ in range(1200):
        error = error * np.exp(-DT / 3.0) + rng.normal(0.0, std * np.sqrt(1 - np.exp(-2 * DT / 3.0)))
        errors.append(error + rng.normal(0.0, 0.1))
    noise = learned(errors, row_of(0.15, told=False))
    assert np.sqrt(noise["white_var"]) < 0.5 * std + 0.1
    assert np.sqrt(noise["lasting_var"]) == pytest.approx(std, rel=0.6)


def test_a_tag_is_not_precise_before_it_has_shown_it_unless_that_was_told() -> None:
    first = range_at(0.0, 20.0)
    untold, told, reported = row_of(0.15, told=False), row_of(0.15, told=True), row_of(0.15, told=False)
    learn_white(untold, first, T)
    learn_white(told, first, T)
    learn_white(reported, range_at(0.0, 20.0, reported=0.1), T)
    assert untold["noise"]["factor"] > 30.0
    assert told["noise"]["factor"] < 1.2
    assert reported["noise"]["factor"] < 1.2
    assert np.sqrt(reported["noise"]["white_var"]) == pytest.approx(0.1)


def test_a_told_noise_gives_way_up_to_four_times_its_deviation() -> None:
    noise = learned(np.full(200, 1.0), row_of(0.15, told=True))
    assert noise["factor"] == pytest.approx(16.0, rel=0.05)


def test_doubt_takes_back_certainty_up_to_that_of_the_start() -> None:
    row = row_of(0.15, told=False)
    rng = np.random.default_rng(4)
    root = rng.normal(size=(N, N)) * 0.03
    one, _ = hypothesis_of(np.full(N, 5.0), root @ root.T)
    before = one["cov"].copy()
    one["log_weight"] = -8.0
    work = make_workspace()[0]["hypotheses"]
    work[0] = one
    doubt(work, 1, row, 4.0)
    after = work[0]["cov"]
    assert work[0]["log_weight"] == -2.0
    assert after[R, R] == pytest.approx(4.0 * before[R, R])
    assert np.linalg.eigvalsh(after).min() > -1e-12
    doubt(work, 1, row, 1e9)
    assert work[0]["cov"][R, R] == pytest.approx(25.0)
