"""The step detector against the phase of the vertical motion, which a Fourier transform gives without any peaks.

Seeds 5900 to 5905.
"""

from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.fleet.frontend.gait import (
    FULL_SWING,
    GAIT,
    MM_PER_M,
    WALK,
    add_step_sample,
    start_gait,
    step_speed,
)
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from dropanchor_tag_client.simulator.walking import simulate_walk

SEEDS = range(5900, 5906)
STEP_HZ = (1.2, 2.6)


def detect(g: Any, t: Any, size: Any, steps: Any, speed: Any) -> None:
    start_gait(g, size[0])
    for k in range(1, len(t)):
        steps[k] = add_step_sample(g, t[k] - t[k - 1], size[k])
        speed[k] = step_speed(g)


def count_regular(g: Any, t: Any, size: Any, regular: Any) -> None:
    start_gait(g, size[0])
    for k in range(1, min(len(t), len(regular))):
        add_step_sample(g, t[k] - t[k - 1], size[k])
        regular[k] = g["regular"]


def walk_columns() -> tuple[Any, Any]:
    run = simulate_walk("hand", SEEDS[0])
    return run.imu.t_s, np.linalg.norm(run.imu.acc, axis=1)


def detected(run: Simulation) -> tuple[Any, Any]:
    """Return for each IMU sample whether it completes a step, and the speed of the steps."""
    t, size = run.imu.t_s, np.linalg.norm(run.imu.acc, axis=1)
    steps, speed = np.zeros(len(t), bool), np.zeros(len(t))
    detect(np.zeros(1, GAIT)[0], t, size, steps, speed)
    return steps, speed


def walks(run: Simulation) -> Any:
    """Return for each IMU sample whether the person walks at more than half a metre per second."""
    return np.interp(run.imu.t_s, run.truth.t_s, run.truth.v) > 0.5


def cycles(run: Simulation) -> float:
    """Return how often the acceleration swings at step frequency while the person walks, by its analytic signal."""
    t, size = run.imu.t_s, np.linalg.norm(run.imu.acc, axis=1)
    spectrum, hz = np.fft.fft(size - size.mean()), np.fft.fftfreq(len(size), t[1] - t[0])
    analytic = np.fft.ifft(np.where((hz > STEP_HZ[0]) & (hz < STEP_HZ[1]), 2.0 * spectrum, 0.0))
    turned = np.diff(np.unwrap(np.angle(analytic))) / (2.0 * np.pi)
    return float(turned[walks(run)[1:]].sum())


@pytest.mark.parametrize("carry", ["hand", "pocket", "turned"])
@pytest.mark.parametrize("seed", SEEDS)
def test_there_are_as_many_steps_as_swings_of_the_vertical(carry: Any, seed: int) -> None:
    run = simulate_walk(carry, seed)
    steps, _ = detected(run)
    assert steps[walks(run)].sum() == pytest.approx(cycles(run), rel=0.05)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_steps_give_the_length_of_the_way(seed: int) -> None:
    run = simulate_walk("hand", seed)
    _, speed = detected(run)
    moving = walks(run)
    true = np.interp(run.imu.t_s, run.truth.t_s, run.truth.v)
    assert speed[moving].sum() == pytest.approx(true[moving].sum(), rel=0.2)


@pytest.mark.parametrize("scenario", ["S5", "OU", "forklift"])
def test_a_vehicle_hardly_makes_steps_at_similar_intervals(scenario: str) -> None:
    run, g = simulate(scenario, SEEDS[0]), np.zeros(1, GAIT)[0]
    t, size = run.imu.t_s, np.linalg.norm(run.imu.acc, axis=1)
    regular = np.zeros(len(t))
    count_regular(g, t, size, regular)
    assert regular.max() <= MM_PER_M * FULL_SWING
    count_regular(g, *walk_columns(), regular)
    assert regular.max() > 8 * WALK


def test_a_device_that_was_waved_before_a_walk_hides_no_steps() -> None:
    t = np.arange(0.0, 30.0, 0.02)
    waved = np.where(t < 8.0, 8.0 * np.sin(2.0 * np.pi * t / 0.8), 0.0)
    size = 9.81 + waved + np.where(t > 12.0, 1.2 * np.sin(2.0 * np.pi * t / 0.6), 0.0)
    regular = np.zeros(len(t))
    count_regular(np.zeros(1, GAIT)[0], t, size, regular)
    assert regular[(t > 16.0)].min() >= WALK  # before: not one step was seen
