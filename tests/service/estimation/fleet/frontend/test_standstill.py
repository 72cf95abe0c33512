"""Standstill, and the gyroscope bias learned at rest."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_service.estimation.fleet.frontend.standstill import (
    STANDSTILL,
    at_rest,
    start_standstill,
    update_gyro_bias,
    update_standstill_detector,
)

Array = NDArray[Any]


def watch_all(s: Any, dt: float, acc: Array, gyro: Array, bias: Array, rest: Array) -> None:
    start_standstill(s, acc[0], gyro[0])
    for k in range(len(acc)):
        update_standstill_detector(s, dt, acc[k], gyro[k], bias)
        update_gyro_bias(s, dt, gyro[k], bias)
        rest[k] = at_rest(s)


def watched(acc: Array, gyro: Array, dt: float = 0.01) -> tuple[Array, Array, Array]:
    """Return rest (n,), bias (3,) and the row after the samples."""
    s, bias, rest = np.zeros(1, STANDSTILL), np.zeros(3), np.zeros(len(acc), np.bool_)
    watch_all(s[0], dt, acc, gyro, bias, rest)
    return rest, bias, s[0]


def noise(seed: int, n: int, acc_sd: float, gyro_sd: float, rate: float = 0.0) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    return rng.normal([0, 0, 9.8], acc_sd, (n, 3)), rng.normal([0, 0, rate], gyro_sd, (n, 3))


@pytest.mark.parametrize(
    ("acc_sd", "gyro_sd", "rate", "expected"),
    [
        (0.014, 0.003, 0.0, True),  # a device on a table
        (0.02, 0.01, 0.005, True),  # noisier, with a bias
        (0.02, 0.02, 0.0, True),  # a gyroscope of 0.1 deg/s/sqrt(Hz)
        (0.1, 0.003, 0.0, False),  # rolling
        (0.014, 0.1, 0.0, False),  # swaying
        (0.014, 0.003, 0.3, False),  # on a smooth turntable
    ],
)
def test_rest_is_what_neither_shakes_nor_turns(acc_sd: float, gyro_sd: float, rate: float, expected: bool) -> None:
    rest, _, _ = watched(*noise(3, 3000, acc_sd, gyro_sd, rate))
    assert rest[200:].mean() == expected


def test_rest_begins_within_a_second_and_ends_within_a_tenth() -> None:
    still, moving = noise(4, 500, 0.014, 0.002), noise(5, 500, 0.3, 0.05)
    acc, gyro = (np.concatenate([moving[i], still[i], moving[i]]) for i in (0, 1))
    rest, _, _ = watched(acc, gyro)
    assert not rest[100:500].any()
    assert rest[600:1000].all()
    assert not rest[1010:].any()


def test_a_stop_after_hard_braking_is_seen_within_six_tenths() -> None:
    braking, still = noise(13, 80, 0.1, 0.005), noise(14, 200, 0.014, 0.002)
    braking[0][:, 0] -= 4.0 * np.sin(np.linspace(0.0, np.pi, 80))
    acc, gyro = (np.concatenate([braking[i], still[i]]) for i in (0, 1))
    rest, _, _ = watched(acc, gyro)
    assert not rest[:85].any()
    assert rest[140:].all()


def test_each_rest_teaches_a_bias_that_has_wandered_since_the_last_one() -> None:
    moving, first, later = noise(15, 3000, 0.3, 0.05), noise(16, 300, 0.014, 0.005), noise(17, 300, 0.014, 0.005, 0.002)
    acc, gyro = (np.concatenate([first[i], moving[i], later[i]]) for i in (0, 1))
    _, bias, row = watched(acc, gyro)
    assert bias[2] == pytest.approx(0.002, abs=8e-4)
    assert abs(bias[2] - 0.002) < 2.5 * np.sqrt(row["bias_var"])


@pytest.mark.parametrize("dt", [0.005, 0.01, 0.052])
def test_the_bias_is_learned_at_rest_at_any_rate_of_samples(dt: float) -> None:
    acc, gyro = noise(6, int(6 / dt), 0.014, 0.003)
    _, bias, row = watched(acc, gyro + np.array([0.01, -0.015, 0.008]), dt)
    assert bias == pytest.approx([0.01, -0.015, 0.008], abs=1.5e-3)
    assert np.sqrt(row["bias_var"]) < 2e-3


def test_a_short_pause_teaches_nothing_and_a_start_does_not_spoil_what_was_learned() -> None:
    moving = noise(7, 300, 0.3, 0.05)
    pause = noise(8, 90, 0.014, 0.002, rate=0.015)
    acc, gyro = (np.concatenate([moving[i], pause[i], moving[i]]) for i in (0, 1))
    assert (watched(acc, gyro)[1] == 0).all()
    still = noise(9, 600, 0.014, 0.002)
    slow_start = noise(10, 40, 0.014, 0.002, rate=0.015)
    acc, gyro = (np.concatenate([still[i], slow_start[i], moving[i]]) for i in (0, 1))
    assert abs(watched(acc, gyro)[1]).max() < 1e-3


def test_a_second_of_rest_at_switch_on_teaches_the_bias_and_the_same_second_later_does_not() -> None:
    moving = noise(11, 300, 0.3, 0.05)
    rest = noise(12, 100, 0.03, 0.005, rate=0.012)
    acc, gyro = (np.concatenate([rest[i], moving[i]]) for i in (0, 1))
    _, bias, row = watched(acc, gyro)
    assert bias[2] == pytest.approx(0.012, abs=3.0 * np.sqrt(row["bias_var"]))
    assert np.sqrt(row["bias_var"]) < 2.5e-3
    acc, gyro = (np.concatenate([moving[i], rest[i][:90], moving[i]]) for i in (0, 1))
    assert (watched(acc, gyro)[1] == 0).all()


@pytest.mark.parametrize(("acc_sd", "share"), [(0.05, 0.001), (0.046, 0.02)])
def test_noise_as_large_as_the_limit_is_hardly_ever_rest(acc_sd: float, share: float) -> None:
    shares = [watched(*noise(seed, 6000, acc_sd, 0.003))[0].mean() for seed in range(20, 30)]
    assert np.mean(shares) < share
