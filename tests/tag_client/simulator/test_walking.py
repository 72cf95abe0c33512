"""Simulated walks are reproducible and self-consistent, and shake the device like recorded walks."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_tag_client.recording import read_recording
from dropanchor_tag_client.simulator.ranging import AnchorPlace, Ranges
from dropanchor_tag_client.simulator.sensors import noiseless
from dropanchor_tag_client.simulator.trajectory import Segment, Start, drive
from dropanchor_tag_client.simulator.walking import CARRIES, Carry, behind_the_walker, simulate_walk, walking_sensors
from support.recordings import recording_or_skip

Array = NDArray[np.float64]
BANDS = ((0.7, 1.3), (1.7, 2.3), (2.3, 3.3))  # of the step frequency


def upward(acc: Array, hz: float) -> Array:
    """Return the acceleration along gravity, estimated as the mean over 6 s."""
    kernel = np.ones(int(6 * hz)) / int(6 * hz)
    gravity = np.column_stack([np.convolve(np.pad(axis, len(kernel), "edge"), kernel, "same") for axis in acc.T])
    gravity = gravity[len(kernel) : -len(kernel)]
    size = np.sqrt((gravity**2).sum(axis=1))
    along: Array = (acc * gravity).sum(axis=1) / size - size
    return along


def spectrum(signal: Array, hz: float) -> tuple[float, list[float]]:
    """Return the step frequency, Hz, and the RMS in each band."""
    frequency = np.fft.rfftfreq(len(signal), 1 / hz)
    power = 2 * np.abs(np.fft.rfft(signal)) ** 2 / len(signal) ** 2
    near = (frequency > 1.2) & (frequency < 2.6)
    step = float(frequency[near][np.argmax(np.convolve(power, np.ones(5), "same")[near])])
    inside = [(frequency >= low * step) & (frequency < high * step) for low, high in BANDS]
    return step, [float(np.sqrt(power[band].sum())) for band in inside]


def measured(acc: Array, hz: float) -> Array:
    step, bands = spectrum(upward(acc, hz), hz)
    return np.array([step, *bands])


def simulated() -> Array:
    walks = [simulate_walk("hand", seed) for seed in range(5000, 5008)]
    return np.median([measured(walk.imu.acc[::2], 50.0) for walk in walks], axis=0)


def test_the_hand_shakes_as_in_recorded_walks() -> None:
    recorded = [1.84, 2.80, 1.34, 0.86]  # step frequency, Hz, and bands of the upward acceleration, m/s²
    np.testing.assert_allclose(simulated(), recorded, rtol=0.2)


def test_the_recorded_walks_shake_the_hand_as_the_simulated_ones_do() -> None:
    folders = sorted(recording_or_skip("phones").glob("ms*_front"))
    axes = [read_recording(folder).imu for folder in folders]
    acc = [np.column_stack([np.asarray(imu[name]) for name in ("ax", "ay", "az")]) for imu in axes]
    np.testing.assert_allclose(simulated(), np.median([measured(one, 50.0) for one in acc], axis=0), rtol=0.2)


@pytest.mark.parametrize("carry", CARRIES)
def test_the_same_seed_gives_the_same_walk_and_another_seed_another(carry: Carry) -> None:
    one, again, other = simulate_walk(carry, 5000), simulate_walk(carry, 5000), simulate_walk(carry, 5001)
    np.testing.assert_array_equal(one.imu.acc, again.imu.acc)
    np.testing.assert_array_equal(one.ranges.range_m, again.ranges.range_m)
    assert len(one.imu.acc) != len(other.imu.acc) or not np.array_equal(one.imu.acc, other.imu.acc)


@pytest.mark.parametrize("carry", CARRIES)
def test_a_walk_has_a_plausible_speed_and_samples_of_every_sensor(carry: Carry) -> None:
    walk = simulate_walk(carry, 5002)
    truth = walk.truth
    assert 45.0 < truth.t_s[-1] < 120.0
    assert 1.0 < np.median(truth.v[truth.v > 0.5]) < 1.5
    assert len(walk.imu.t_s) == len(truth.t_s)
    assert np.isfinite(walk.imu.mag).all()
    rate = len(walk.ranges.t_s) / truth.t_s[-1]
    assert 7.5 < rate < 10.1
    assert np.hypot(truth.x, truth.y).max() < 120.0


def rotation(quaternion: Array) -> Array:
    w, x, y, z = quaternion
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross)


def rotation_by(vector: Array) -> Array:
    angle = math.sqrt(float(vector @ vector))
    axis = vector / angle if angle else vector
    return rotation(np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * axis]))


def angle_of(turn: Array) -> float:
    return math.acos(max(-1.0, min(1.0, (float(np.trace(turn)) - 1.0) / 2.0)))


@pytest.mark.parametrize("carry", CARRIES)
def test_perfect_gyros_integrate_to_the_attitude_of_the_device(carry: Carry) -> None:
    walk = simulate_walk(carry, 5003, walking_sensors(noiseless()))
    turn = np.eye(3)
    for rate in walk.imu.gyro[1:]:
        turn = turn @ rotation_by(rate * 0.01)
    first, last = (rotation(walk.truth.attitude[row]) for row in (0, -1))
    # The device is fixed to the swinging frame: both turn by the same angle, about axes that differ.
    assert angle_of(turn) == pytest.approx(angle_of(first.T @ last), abs=0.1)


def test_at_rest_the_accelerometer_measures_gravity_alone() -> None:
    for carry in CARRIES:
        walk = simulate_walk(carry, 5004, walking_sensors(noiseless()))
        still = walk.imu.acc[walk.truth.t_s < 0.9]
        np.testing.assert_allclose(np.sqrt((still**2).sum(axis=1)), 9.80665, rtol=1e-3)


def test_a_turned_device_turns_by_a_right_angle_and_its_carrier_does_not() -> None:
    truth = simulate_walk("turned", 5005).truth
    mount = truth.course - truth.heading
    step = float(np.abs(mount[150:] - mount[:-150]).max())
    assert step == pytest.approx(math.pi / 2, abs=0.4)
    walk = simulate_walk("hand", 5005).truth
    assert float(np.ptp(walk.course - walk.heading)) < 1.2


def test_ranges_are_nlos_from_behind_the_walker_and_not_from_ahead() -> None:
    away = drive([Segment(5.0, 1.2)], Start(10.0, 0.0, 0.0), 0.01)
    towards = drive([Segment(5.0, 1.2)], Start(20.0, 0.0, math.pi), 0.01)
    one = np.ones(1)
    ranges = Ranges(one, np.zeros(1, np.int64), 10.0 * one, one)
    assert behind_the_walker(away, ranges, [AnchorPlace()]) == pytest.approx([1.0])
    assert behind_the_walker(towards, ranges, [AnchorPlace()]) == pytest.approx([0.0])
