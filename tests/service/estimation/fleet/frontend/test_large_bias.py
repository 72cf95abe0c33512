"""A gyroscope that reads degrees per second at rest."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_service.estimation.fleet.frontend.state import start_frontend
from support.frontend import new_frontend, run
from support.imu import Motion, synthesise, wrapped

Array = NDArray[Any]
BIAS = np.array([0.09, -0.06, 0.12])  # rad/s: 9 degrees per second, of a cheap gyroscope
IRON = (0.8, -1.5, 0.4)  # of the field: a battery beside a magnetometer that nobody has calibrated
MEASURED = np.array(IRON) + np.array([0.0, 0.4, -0.9])
ABOUT_THE_FIELD = 0.12 * MEASURED / np.linalg.norm(MEASURED)
ENDS = np.arange(0.1, 8.0, 0.1)


def still(t: Array) -> Array:
    return np.zeros((len(t), 3))


def on_a_turntable(t: Array) -> Array:
    """Turn by 8 degrees per second."""
    return np.stack([0.14 * t, 0 * t, 0 * t], axis=1)


def samples(angles: Any = still, field: bool = True, bias: Array = BIAS) -> Motion:
    """Return 8 s of noisy samples of a motion whose accelerations are those of rest."""
    rng = np.random.default_rng(3)
    m = synthesise(np.arange(0.0, 8.0, 0.01), angles)
    m.gyro += bias + rng.normal(0.0, 0.004, m.gyro.shape)
    m.acc += rng.normal(0.0, 0.03, m.acc.shape)
    m.mag += np.array(IRON) + rng.normal(0.0, 0.01, m.mag.shape)
    if not field:
        m.mag[:] = math.nan
    return m


def held(m: Motion, samples: int) -> Motion:
    """Let the field be one that is read anew only after so many samples."""
    m.mag[:] = m.mag[np.arange(len(m.t)) // samples * samples]
    return m


def shaken_until(m: Motion, t: float) -> Motion:
    m.acc += np.where(m.t < t, np.random.default_rng(4).normal(0.0, 1.0, m.acc.shape).T, 0.0).T
    return m


@pytest.mark.parametrize(
    ("field", "bias", "after"), [(True, BIAS, 1.5), (False, BIAS, 3.6), (True, ABOUT_THE_FIELD, 3.6)]
)
def test_a_rest_tells_it(field: bool, bias: Array, after: float) -> None:
    front_end = new_frontend()
    nodes = run(front_end, samples(field=field, bias=bias), ENDS)

    assert front_end[0]["attitude"]["bias"] == pytest.approx(bias, abs=1e-3)
    assert nodes["rest"][after < ENDS].all()
    assert wrapped(nodes["dyaw"].sum()) == pytest.approx(0.0, abs=0.01), "what the bias turned is turned back"
    told = np.isfinite(nodes["dv_var"])
    assert not told[(ENDS > 0.3) & (ENDS < 0.7)].any(), "a tilt that the bias makes is no acceleration"
    assert told[after < ENDS].all()


def test_a_field_that_is_read_once_a_second_is_no_proof_of_rest() -> None:
    front_end = new_frontend()
    turned = run(front_end, held(shaken_until(samples(on_a_turntable, bias=0.0 * BIAS), 1.0), 100), ENDS)["dyaw"].sum()

    assert turned == pytest.approx(0.14 * ENDS[-1], rel=0.05)


@pytest.mark.parametrize("rate", ["rising", "large"])
def test_what_no_bias_is_like_is_none(rate: str) -> None:
    """From switch-on, without a magnetometer and without shaking."""
    front_end, m = new_frontend(), samples(field=False, bias=np.array([0.0, 0.0, 0.6 if rate == "large" else 0.06]))
    m.gyro[:, 2] += 0.05 * m.t if rate == "rising" else 0.0
    run(front_end, m, ENDS)

    assert abs(front_end[0]["attitude"]["bias"][2]) < 0.02


def test_without_a_field_only_a_new_tag_has_a_first_rest() -> None:
    front_end = new_frontend()
    run(front_end, shaken_until(samples(bias=0.0 * BIAS), 8.0), ENDS)
    start_frontend(front_end[0], 1.0, 0.0)
    m = samples(on_a_turntable, field=False, bias=0.0 * BIAS)
    m.t = m.t + 10.0

    assert run(front_end, m, 10.0 + ENDS)["dyaw"].sum() == pytest.approx(0.14 * ENDS[-1], rel=0.05)


def test_a_false_one_goes_at_the_next_rest() -> None:
    front_end = new_frontend()
    run(front_end, samples(on_a_turntable, field=False, bias=0.0 * BIAS), ENDS)
    assert front_end[0]["attitude"]["bias"][2] == pytest.approx(0.14, abs=0.01), "a turntable at switch-on"
    m = shaken_until(samples(bias=0.0 * BIAS), 1.0)
    m.t = m.t + 8.1
    run(front_end, m, 8.1 + ENDS)

    assert front_end[0]["attitude"]["bias"] == pytest.approx(np.zeros(3), abs=2e-3)


@pytest.mark.parametrize("field", [True, False])
def test_a_tag_that_turns_evenly_keeps_its_turn(field: bool) -> None:
    """Without a magnetometer it has shaken before: nothing else tells the two apart."""
    front_end = new_frontend()
    turned = run(front_end, shaken_until(samples(on_a_turntable, field, 0.0 * BIAS), 1.0), ENDS)["dyaw"].sum()

    assert turned == pytest.approx(0.14 * ENDS[-1], rel=0.05)
    assert abs(front_end[0]["attitude"]["bias"][2]) < 0.02


def test_later_rests_tell_it_by_the_field_alone() -> None:
    with_field, without = new_frontend(), new_frontend()
    run(with_field, shaken_until(samples(), 1.0), ENDS)
    run(without, shaken_until(samples(field=False), 1.0), ENDS)

    assert with_field[0]["attitude"]["bias"] == pytest.approx(BIAS, abs=2e-3)
    assert np.linalg.norm(without[0]["attitude"]["bias"] - BIAS) > 0.05
