"""Hard iron, north and disturbances, on synthetic rotations through the whole front-end."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_service.estimation.fleet.frontend.node import ABSOLUTE_HEADING, RELATIVE_HEADING
from support.frontend import new_frontend, run
from support.imu import Motion, synthesise, turning, wrapped

Array = NDArray[Any]
IRON = np.array([0.5, -0.8, 0.9])  # as large as the field, whose norm is 1


def noisy(seconds: float, rate: float = 0.6, unit: float = 1.0, iron: Array = IRON, seed: int = 1) -> Motion:
    """Return the motion of a circling, swaying tag with white noise and hard iron."""
    rng = np.random.default_rng(seed)
    m = synthesise(np.arange(0, seconds, 0.01), lambda t: turning(t, rate))
    m.mag = unit * (m.mag + iron + rng.normal(0, 0.02, m.mag.shape))
    m.gyro += rng.normal(0, 0.01, m.gyro.shape)
    m.acc += rng.normal(0, 0.2, m.acc.shape)
    return m


def ends_of(m: Motion) -> Array:
    return np.arange(m.t[0] + 0.1, m.t[-1], 0.1)


def heading_error(m: Motion, nodes: Array, ends: Array) -> Array:
    """Return the heading error in rad."""
    return wrapped(nodes["heading"] - np.interp(ends, m.t, np.unwrap(m.yaw)))


def test_hard_iron_as_large_as_the_field_is_found_and_the_heading_becomes_absolute() -> None:
    m = noisy(60)
    rows = new_frontend()
    nodes = run(rows, m, ends := ends_of(m))
    absolute = nodes["heading_kind"] == ABSOLUTE_HEADING
    assert not absolute[:10].any()
    assert absolute[ends > 10].all()
    e = heading_error(m, nodes, ends)
    assert abs(e[ends > 15]).max() < math.radians(3.2)
    assert abs(e[absolute] / np.sqrt(nodes["heading_var"][absolute])).max() < 3
    assert rows[0]["magnetometer"]["x"][3:5] == pytest.approx(IRON[:2], abs=0.03)


@pytest.mark.parametrize("unit", [1e-3, 50.0])
def test_the_unit_of_the_magnetometer_does_not_matter(unit: float) -> None:
    one, other = noisy(30), noisy(30, unit=unit)
    ends = ends_of(one)
    a, b = run(new_frontend(), one, ends), run(new_frontend(), other, ends)
    assert abs(wrapped(a["heading"] - b["heading"])).max() < 1e-6
    assert b["heading_var"] == pytest.approx(a["heading_var"], rel=1e-6)


def test_without_a_turn_hard_iron_is_hardly_known_and_the_heading_stays_relative() -> None:
    m = noisy(60, rate=0.0)
    nodes = run(new_frontend(), m, ends := ends_of(m))
    assert (nodes["heading_kind"][ends < 45] == RELATIVE_HEADING).all()  # swaying tells a little of it, slowly
    late = nodes["heading_kind"] == ABSOLUTE_HEADING
    assert (abs(heading_error(m, nodes, ends)) < 2 * np.sqrt(nodes["heading_var"]))[late].all()


def test_a_calibrated_magnetometer_is_absolute_at_once_and_counts_declination_east() -> None:
    m = noisy(20, rate=0.0, iron=np.zeros(3))
    nodes = run(new_frontend(hard_iron=0.05, declination=0.1), m, ends := ends_of(m))
    settled = ends > 2
    assert (nodes["heading_kind"][settled] == ABSOLUTE_HEADING).all()
    assert abs(heading_error(m, nodes, ends)[settled] + 0.1).max() < math.radians(4)


def test_a_disturbance_makes_the_heading_uncertain_and_does_not_turn_it() -> None:
    calm, steel = noisy(90), noisy(90)
    during = (steel.t > 50) & (steel.t < 65)
    steel.mag[during] += steel.attitude[during].inv().apply([0.5, 0.0, 0.0])
    ends = ends_of(calm)
    a, b = run(new_frontend(), calm, ends), run(new_frontend(), steel, ends)
    inside = (ends > 51) & (ends < 65)
    assert abs(heading_error(steel, b, ends)[inside]).max() < math.radians(3)
    assert (b["heading_var"][inside] > a["heading_var"][inside]).all()
    assert (np.diff(b["heading_var"][inside][::10]) > 0).all()
    assert abs(heading_error(steel, b, ends)[ends > 66]).max() < math.radians(3)


@pytest.mark.parametrize("seconds", [0.5, 2.0, 5.0, 8.0])
def test_after_a_turn_without_samples_the_field_and_the_known_hard_iron_give_the_heading(
    seconds: float,
) -> None:
    m = noisy(60)
    m = m.at((m.t < 30) | (m.t > 30 + seconds))
    rows = new_frontend()
    nodes = run(rows, m, ends := ends_of(m))
    after = (ends > 30.5 + seconds) & (nodes["heading_kind"] == ABSOLUTE_HEADING)
    e = heading_error(m, nodes, ends)
    assert after.sum() > 150
    assert abs(e / np.sqrt(nodes["heading_var"]))[after].max() < 3
    assert abs(e[ends > 45 + seconds]).max() < math.radians(8)
    assert rows[0]["magnetometer"]["x"][3:5] == pytest.approx(IRON[:2], abs=0.03)


def test_a_field_that_stays_changed_is_given_up_and_learned_anew() -> None:
    m = noisy(180)
    m.mag[m.t > 40] += [1.0, 0.6, -0.5]  # a magnet glued to the tag
    nodes = run(new_frontend(), m, ends := ends_of(m))
    e = abs(heading_error(m, nodes, ends))
    assert e[(ends > 41) & (ends < 69)].max() < math.radians(4)
    assert nodes["heading_var"][(ends > 71) & (ends < 80)].max() > 0.02
    assert e[ends > 120].max() < math.radians(4)


def test_a_magnetometer_slower_than_the_imu_and_with_holes_is_enough() -> None:
    m = noisy(60)
    slow = np.arange(len(m.t)) % 13 != 0
    m.mag[slow | ((m.t > 30) & (m.t < 40))] = np.nan
    nodes = run(new_frontend(), m, ends := ends_of(m))
    assert (nodes["heading_kind"][ends > 12] == ABSOLUTE_HEADING).all()
    assert abs(heading_error(m, nodes, ends)[ends > 20]).max() < math.radians(4)


def test_a_gyroscope_bias_left_over_is_followed_by_the_field() -> None:
    m = noisy(180)
    m.gyro[:, 2] += 2e-3
    nodes = run(new_frontend(), m, ends := ends_of(m))
    assert math.degrees(2e-3 * 180) > 20
    assert abs(heading_error(m, nodes, ends)[ends > 30]).max() < math.radians(4)


def test_the_heading_of_a_resting_tag_does_not_become_more_certain() -> None:
    rng = np.random.default_rng(3)
    m = synthesise(np.arange(0, 600, 0.05), lambda t: np.zeros((len(t), 3)))
    m.mag = m.mag + 0.05 + rng.normal(0, 0.01, m.mag.shape)
    m.acc += rng.normal(0, 0.01, m.acc.shape)
    m.gyro += rng.normal(0, 0.002, m.gyro.shape)
    nodes = run(new_frontend(hard_iron=0.3), m, ends := ends_of(m))
    assert nodes["rest"][ends > 2].all()
    assert abs(np.diff(nodes["heading"][ends > 10])).max() < 1e-3
    assert nodes["heading_var"][-1] > 0.9 * nodes["heading_var"][ends > 10][0]


def test_soft_iron_of_ten_percent_stays_inside_the_published_variance() -> None:
    m = noisy(120)
    m.mag = m.mag @ np.array([[1.1, 0.05, 0.0], [0.05, 0.92, 0.03], [0.0, 0.03, 1.0]])
    nodes = run(new_frontend(), m, ends := ends_of(m))
    e = heading_error(m, nodes, ends)
    absolute = nodes["heading_kind"] == ABSOLUTE_HEADING
    assert np.mean(abs(e / np.sqrt(nodes["heading_var"]))[absolute] < 2) > 0.95
    assert abs(e[ends > 20]).max() < math.radians(6)


def magnetised(seconds: tuple[float, float]) -> tuple[Motion, Array, Array]:
    """Return a motion straight ahead for 20 s and then in a circle, its node ends, and nodes with a magnet on it."""
    t = np.arange(0, 90, 0.01)
    m = synthesise(t, lambda at: turning(np.maximum(at - 20.0, 0.0)))
    rng = np.random.default_rng(6)
    m.mag += IRON + rng.normal(0, 0.02, m.mag.shape)
    m.gyro += rng.normal(0, 0.01, m.gyro.shape)
    m.acc += rng.normal(0, 0.2, m.acc.shape)
    m.mag[(t > seconds[0]) & (t < seconds[1])] += [0.0, 0.8, 0.0]
    return m, (ends := ends_of(m)), run(new_frontend(), m, ends)


def test_a_magnet_is_told_from_hard_iron_because_it_comes_suddenly() -> None:
    m, ends, nodes = magnetised((20.0, 28.0))
    absolute = nodes["heading_kind"] == ABSOLUTE_HEADING
    assert absolute[ends > 80].all()
    assert abs(heading_error(m, nodes, ends) / np.sqrt(nodes["heading_var"]))[absolute].max() < 3
