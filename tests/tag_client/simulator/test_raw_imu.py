"""Raw 9-axis samples agree with their motion."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dropanchor_tag_client.simulator.imu import GRAVITY, Imu
from dropanchor_tag_client.simulator.perturbations import perturbed
from dropanchor_tag_client.simulator.scalar import wrapped
from dropanchor_tag_client.simulator.sensors import SensorModels, noiseless
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from dropanchor_tag_client.simulator.trajectory import Array


def rolling(mount: float = 0.0, rocking: float = 0.02) -> SensorModels:
    """Return perfect sensors on a body that leans and rocks."""
    models = noiseless()
    return replace(models, mount_rad=mount, imu=replace(models.imu, rocking_std=rocking, lean_std=0.05))


def into_site(attitude: Array, vectors: Array) -> Array:
    """Rotate vectors (n, 3) by unit quaternions (w, x, y, z), (n, 4): v + 2 w (u × v) + 2 u × (u × v)."""
    w, u = attitude[:, :1], attitude[:, 1:]
    once = np.cross(u, vectors)
    return np.asarray(vectors + 2 * (w * once + np.cross(u, once)))


def level_heading(imu: Imu) -> Array:
    """Return the heading of a level body from its magnetometer, with magnetic north at +y."""
    return np.asarray(np.pi / 2 - np.arctan2(imu.mag[:, 1], imu.mag[:, 0]))


@pytest.mark.parametrize("mount", [0.0, 0.6, -2.5])
def test_specific_force_is_acceleration_plus_gravity_in_body_axes(mount: float) -> None:
    run = simulate("M5", 4, rolling(mount))
    in_site = into_site(run.truth.attitude, run.imu.acc)
    velocity = run.truth.v[:, None] * np.column_stack([np.cos(run.truth.course), np.sin(run.truth.course)])
    acceleration = np.diff(velocity, axis=0) / 0.01
    assert in_site[1:, :2] == pytest.approx(acceleration, abs=0.15)
    assert np.sqrt(((in_site[1:, :2] - acceleration) ** 2).mean()) < 0.01
    assert in_site[:, 2] == pytest.approx(np.full(len(in_site), GRAVITY))


def test_the_gyro_integrates_to_the_attitude() -> None:
    run = simulate("M5", 4, rolling(mount=0.3))
    attitude = run.truth.attitude[0]
    for rate in run.imu.gyro[1:]:
        angle = np.linalg.norm(rate) * 0.01
        half = np.concatenate([[1.0], rate * 0.005 * np.sinc(angle / math.tau)])
        half[0] = math.cos(angle / 2)
        attitude = product(attitude, half)
    apart = 2 * np.arccos(min(1.0, abs(float(attitude @ run.truth.attitude[-1]))))
    assert apart < 2e-3


def product(a: Array, b: Array) -> Array:
    (w, x, y, z), (s, i, j, k) = a, b
    return np.array(
        [
            w * s - x * i - y * j - z * k,
            w * i + x * s + y * k - z * j,
            w * j - x * k + y * s + z * i,
            w * k + x * j - y * i + z * s,
        ]
    )


def test_the_gyro_of_a_level_body_integrates_to_the_heading() -> None:
    run = simulate("P", 0, noiseless())
    turned = np.cumsum(run.imu.gyro[:, 2]) * 0.005
    assert turned == pytest.approx(run.truth.heading - run.truth.heading[0], abs=1e-9)
    assert not run.imu.gyro[:, :2].any()


@pytest.mark.parametrize("mount", [0.0, 1.0])
def test_the_magnetometer_points_to_north_which_is_y(mount: float) -> None:
    run = simulate("S5", 3, replace(noiseless(), mount_rad=mount))
    assert wrapped(level_heading(run.imu) - run.truth.heading) == pytest.approx(0.0, abs=1e-9)
    assert run.truth.heading == pytest.approx(run.truth.course - mount)
    assert np.hypot(run.imu.mag[:, 0], run.imu.mag[:, 1]) == pytest.approx(48.5 * math.cos(math.radians(64.5)))
    assert np.all(run.imu.mag[:, 2] < 0)


def test_the_field_of_a_rolling_body_is_the_site_s_field() -> None:
    run = simulate("M5", 3, rolling())
    in_site = into_site(run.truth.attitude, run.imu.mag)
    assert in_site == pytest.approx(np.broadcast_to(in_site[0], in_site.shape), abs=1e-9)
    assert in_site[0, 0] == pytest.approx(0.0, abs=1e-9)


def test_declination_is_true_minus_magnetic_north_positive_east() -> None:
    models = replace(noiseless(), imu=replace(noiseless().imu, declination_rad=0.1))
    run = simulate("S5", 3, models)
    in_site = into_site(run.truth.attitude, run.imu.mag)
    assert math.atan2(in_site[0, 0], in_site[0, 1]) == pytest.approx(0.1)


def test_a_heading_error_shows_in_the_magnetometer_with_its_sign() -> None:
    run = simulate("S5", 3, perturbed(noiseless(), "hb0.2"))
    assert wrapped(level_heading(run.imu) - run.truth.heading) == pytest.approx(0.2)


def test_a_body_at_rest_does_not_rock() -> None:
    run = simulate("SG", 2, rolling())
    rest = (run.truth.v == 0.0) & (np.roll(run.truth.v, 1) == 0.0) & (run.truth.w == 0.0)
    assert np.abs(run.imu.gyro[rest]).max() == 0.0
    assert np.abs(run.imu.gyro[~rest][:, :2]).max() > 0.001


def errors_of_units(models: SensorModels, seeds: range) -> list[tuple[Array, Array, Array]]:
    """Return the errors of the three sensors of each unit, relative to perfect sensors on the same motion."""
    pairs = [(simulate("S5", seed, models).imu, simulate("S5", seed, noiseless()).imu) for seed in seeds]
    return [(real.acc - ideal.acc, real.gyro - ideal.gyro, real.mag - ideal.mag) for real, ideal in pairs]


def test_noise_and_biases_of_units_follow_their_model() -> None:
    plain = SensorModels()
    models = replace(plain, imu=replace(plain.imu, rocking_std=0.0, lean_std=0.0, acc_scale_std=0.0))
    errors = errors_of_units(models, range(40))
    acc, gyro, _ = (np.array([unit[k].mean(axis=0) for unit in errors]) for k in range(3))
    assert acc.std() == pytest.approx(0.05, rel=0.2)
    assert gyro.std() == pytest.approx(0.01, rel=0.2)
    rest = [(unit[0][:95], unit[1][:95], unit[2][:95]) for unit in errors]
    noise = [np.mean([np.diff(unit[k], axis=0).std() for unit in rest]) / math.sqrt(2) for k in range(3)]
    assert noise == pytest.approx([0.03, 0.005, 0.5], rel=0.05)


def test_iron_moves_and_stretches_the_sphere_of_the_field() -> None:
    plain = noiseless()
    models = replace(plain, imu=replace(plain.imu, hard_iron_std=10.0, soft_iron_std=0.03))
    hard = []
    for seed in range(40):
        run, ideal = simulate("triangle", seed, models), simulate("triangle", seed, plain)
        design = np.column_stack([ideal.imu.mag[:, :2], np.ones(len(ideal.imu.mag))])
        fit, _, rank, _ = np.linalg.lstsq(design, run.imu.mag, rcond=None)
        assert rank == 3
        assert design @ fit == pytest.approx(run.imu.mag, abs=1e-9)
        assert fit[:2, :2] == pytest.approx(np.eye(2), abs=0.15)
        hard.append(fit[2, :2])
    assert np.std(hard) == pytest.approx(10.0, rel=0.25)


def test_magnetic_disturbances_are_episodes() -> None:
    models = replace(noiseless(), imu=replace(noiseless().imu, disturbances_per_min=2.0))
    disturbed: list[Simulation] = [simulate("TUM", seed, models) for seed in range(8)]
    norms = np.array([np.linalg.norm(run.imu.mag, axis=1) for run in disturbed])
    off = np.abs(norms - 48.5) > 0.5
    assert 0.03 < off.mean() < 0.3
    assert 3.0 < np.abs(norms - 48.5).max() < 100.0
