"""The bounds of vehicles: that of the belief where nothing more is unknown, and never lower where more is."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dropanchor_evaluation.bounds.linear import LinearModel
from dropanchor_evaluation.bounds.vehicle import ANY_ANGLE, Knowledge, Motion, raw_model, scalar_model
from dropanchor_evaluation.pcrb import Path, Sensors, position_bound
from dropanchor_service.estimation.columns import Array
from dropanchor_tag_client.simulator.sensors import SensorModels, calibrated, noiseless, preset

N, DT = 400, 0.05
T = DT * np.arange(N)
MODELS = calibrated(preset("paper"))


def curve() -> Motion:
    """Return a rest of 2 s, and then a curve with a changing speed."""
    v = np.clip(T - 2.0, 0.0, 2.0) + np.where(T > 10, 0.5, 0.0)
    w = np.where(v > 0, 0.2, 0.0)
    course = 0.5 + DT * np.cumsum(w)
    x, y = (c + DT * np.cumsum(v * f(course)) for c, f in ((10.0, np.cos), (0.0, np.sin)))
    return Motion(Path(T, x, y, course, v, np.arange(N) % 2 == 0), w)


@pytest.mark.parametrize(("leak", "rtol"), [(0.0, 1e-6), (0.05, 1e-4)])
def test_without_more_unknowns_it_is_the_bound_of_the_belief(leak: float, rtol: float) -> None:
    """The leak of a sample is that of its own instant here, and that of the one before in the bound of the belief."""
    motion = curve()
    moving = replace(motion.path, v=motion.path.v + 0.1)  # no rest, at which only the new bound knows the yaw rate
    scalar = replace(MODELS.scalar, leak_std=leak, acceleration_std_rest=MODELS.scalar.acceleration_std)
    known = Knowledge(sideways=False)  # the belief's bound has no axis to the left
    new = scalar_model(replace(motion, path=moving), replace(MODELS, scalar=scalar), known).bound(0, 0).position
    np.testing.assert_allclose(new, position_bound(moving, Sensors(leak=leak), "with accelerometer"), rtol=rtol)


def less_and_less_known() -> Iterator[tuple[Knowledge, SensorModels]]:
    known, models = Knowledge(yaw=0.05), noiseless()
    models = replace(models, ranges=MODELS.ranges)
    noise: dict[str, Any] = {
        "acc_std": 0.03,
        "gyro_std": 0.005,
        "mag_std": 0.5,
        "vibration_acc": 0.3,
        "vibration_gyro": 0.02,
    }
    yield known, (models := replace(models, imu=replace(models.imu, **noise)))
    more: tuple[dict[str, Any], ...] = (
        *({"gyro_bias_std": 0.01}, {"gyro_wander_std": 0.001}, {"acc_bias_std": 0.05}, {"acc_scale_std": 0.005}),
        *({"lean_std": 0.01}, {"rocking_std": 0.01}, {"hard_iron_std": 0.5}, {"soft_iron_std": 0.01}),
        {"hard_iron_std": 10.0},
    )
    for unknown in more:
        yield known, (models := replace(models, imu=replace(models.imu, **unknown)))
    yield (known := replace(known, mount=0.1)), models
    yield (known := replace(known, mount=ANY_ANGLE)), models
    yield (known := replace(known, slip=0.02)), models
    yield (known := replace(known, slip=0.1)), models
    yield (known := replace(known, sideways=False)), models
    yield replace(known, start=30.0, yaw=ANY_ANGLE, speed=3.0), models


@pytest.mark.parametrize("magnetometer", [True, False])
def test_whatever_is_unknown_in_addition_never_lowers_the_bound(magnetometer: bool) -> None:
    motion, bounds = curve(), []
    for known, models in less_and_less_known():
        bounds.append(raw_model(motion, models, known, magnetometer).bound(0, 0).position)
    for before, after in pairwise(bounds):
        assert (after >= before * (1 - 1e-7)).all()
    assert bounds[-1][-1] > 4 * bounds[0][-1]


def test_a_magnetometer_lowers_the_bound_and_a_rigid_mount_is_one_without_slip() -> None:
    motion, known = curve(), Knowledge(mount=ANY_ANGLE)

    def end(known: Knowledge, magnetometer: bool) -> float:
        return float(raw_model(motion, MODELS, known, magnetometer).bound(0, 0).position[-1])

    assert end(known, True) < 0.8 * end(known, False)
    assert end(replace(known, slip=1e-9), True) == pytest.approx(end(known, True), rel=1e-6)
    assert end(replace(known, mount=1e-9), True) == pytest.approx(end(replace(known, mount=0.0), True), rel=1e-6)


def test_the_errors_of_efficient_estimators_have_the_mean_square_of_the_bound() -> None:
    bound = scalar_model(curve(), MODELS, Knowledge(mount=0.5)).bound(2000, 1)
    squares: Array = np.sum(bound.errors**2, axis=2).mean(axis=1)
    np.testing.assert_allclose(squares, bound.position, rtol=0.15)


def test_a_coefficient_of_a_state_that_does_not_exist_is_an_error() -> None:
    model = LinearModel(3)
    model.state("x", 1.0)
    with pytest.raises(KeyError, match="there is no state 'yaw'"):
        model.observe(1.0, {"x": 1.0, "yaw": 1.0})
