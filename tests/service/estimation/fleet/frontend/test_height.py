"""The height of a tag from its barometer: against the standard atmosphere, and against its own errors."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from dropanchor_service.estimation.columns import Array, HeightMotion
from dropanchor_service.estimation.fleet.configure import HEIGHT_STD
from dropanchor_service.estimation.fleet.frontend.height import (
    ACCEPTED,
    BY_PRESSURE,
    DOUBTED,
    HEIGHT,
    HEIGHT_BOUND,
    UNKNOWN,
    UNUSED,
    add_pressure,
    height_at,
    share_references,
    start_height,
)
from dropanchor_service.estimation.fleet.frontend.node import NODE

T0 = 1_760_000_000_000_000_000
AIR, LOW = 288.15, 101_325.0  # K, Pa
GAS = 8.314462618 / (9.80665 * 0.0289644)  # m/K, of dry air
DRIFT = 0.15 / math.sqrt(30.0)  # m/√s
TAG, REFERENCE = 0, 1

Height = Callable[[float], float]


class Run(NamedTuple):
    """Columns by time: error and standard deviation, m, source, and what became of the pressure."""

    t: Array
    error: Array
    std: Array
    outcome: Array


def pressure(height: float, air: float = AIR) -> float:
    return LOW * math.exp(-height / (GAS * air))


def tags(motion: int = HeightMotion.AUTO, told: float = 1.0) -> Array:
    """Return HEIGHT (2) of a tag and of a reference at 3 m."""
    heights = np.zeros(2, HEIGHT)
    start_height(heights[TAG], motion, told, HEIGHT_STD)
    start_height(heights[REFERENCE], HeightMotion.REFERENCE, 3.0, HEIGHT_STD)
    return heights


def read(heights: Array, t_s: float) -> Any:
    """Return NODE (0-d) with the height of the tag."""
    node = np.zeros(1, NODE)
    height_at(heights[TAG], T0 + round(t_s * 1e9), node[0])
    return node[0]


def run(
    height: Height, seed: int = 20_000, *, noise: float = 0.15, drift: float = DRIFT, air: float = AIR, hz: float = 10.0
) -> Run:
    """Return a minute of pressures at this height, told with its standard deviation."""
    rng = np.random.default_rng(seed)
    heights = tags(told=height(0.0) + HEIGHT_STD * rng.standard_normal())
    t = np.arange(0.0, 60.0, 1.0 / hz)
    weather = np.cumsum(rng.standard_normal(len(t))) * drift / math.sqrt(hz)
    rows = []
    for t_s, shown in zip(t.tolist(), (weather + noise * rng.standard_normal(len(t))).tolist(), strict=True):
        at = T0 + round(t_s * 1e9)
        outcome = add_pressure(heights[TAG], at, pressure(height(t_s) + shown, air), math.nan)
        node = read(heights, t_s)
        rows.append((node["height"] - height(t_s), node["height_std"], outcome))
    error, std, outcomes = np.array(rows).T
    return Run(t, error, std, outcomes)


def level(_: float) -> float:
    return 1.0


def lift(t_s: float) -> float:
    return 1.0 + min(max(t_s - 20.0, 0.0) * 1.5, 10.0)


def sine(t_s: float) -> float:
    return 1.0 + 10.0 * math.sin(2.0 * math.pi * t_s / 60.0)


def stairs(t_s: float) -> float:
    return 1.0 + 0.17 * math.floor(min(max(t_s - 10.0, 0.0) / 0.55, 40.0))


def test_a_climb_is_that_of_the_standard_atmosphere() -> None:
    """At h m the ICAO standard atmosphere has 101325 (1 - 2.25577e-5 h)^5.25588 Pa."""
    heights = tags(told=0.0)
    for t_s in np.arange(0.0, 20.0, 0.1).tolist():
        climbed = min(max(t_s - 5.0, 0.0), 10.0)
        p = LOW * (1.0 - 2.25577e-5 * climbed) ** 5.25588
        add_pressure(heights[TAG], T0 + round(t_s * 1e9), p, 15.0)
    assert read(heights, 20.0)["height"] == pytest.approx(10.0, abs=0.02)


@pytest.mark.parametrize(("height", "most"), [(level, 0.999), (lift, 0.999), (sine, 1.0), (stairs, 0.999)])
def test_the_height_follows_with_errors_of_the_size_that_it_claims(height: Height, most: float) -> None:
    """A barometer that is not late is better than it has to be while it climbs, as the sine does all the time."""
    runs = [run(height, seed) for seed in range(20_000, 20_012)]
    errors, stds = (np.concatenate([getattr(one, name) for one in runs]) for name in ("error", "std"))
    assert np.sqrt(np.mean(errors**2)) < 0.4
    sigmas = np.abs(errors / stds)
    assert sigmas.max() < 5.0
    assert 0.9 < np.mean(sigmas < 1.96) <= most
    assert all((one.outcome == ACCEPTED).all() for one in runs)


def test_a_door_that_slams_is_doubted_and_widens_the_height() -> None:
    def slammed(t_s: float) -> float:
        return 1.0 - (16.0 if 30.0 <= t_s < 31.0 else 0.0)  # 2 hPa more for one second

    found = run(slammed)
    error = found.error + np.array([slammed(t) for t in found.t.tolist()]) - 1.0
    assert np.abs(error).max() < 1.0
    assert np.flatnonzero(found.outcome == DOUBTED).tolist() == list(range(300, 310))
    assert found.std[300:310].min() > 15.0
    assert found.std[310:].max() < 1.0


@pytest.mark.parametrize("climb", [3.0, 5.0, 10.0])
def test_a_pressure_that_jumps_is_height_or_air_and_neither_is_believed(climb: float) -> None:
    found = run(lambda t_s: 1.0 + (climb if t_s >= 30.0 else 0.0), seed=20_001)
    assert np.abs(found.error / found.std).max() < 5.0
    after = found.t > 32.5
    for error in (found.error[after], found.error[after] + climb):  # it has climbed; or the air has changed
        assert np.abs(error / found.std[after]).max() < 1.5


def test_a_barometer_that_is_late_in_a_lift_does_not_lie() -> None:
    def late(t_s: float) -> float:
        """Return what a first-order lag of 1.5 s leaves of a lift that has 1.5 m/s from 20 s on, for 10 m."""
        up = min(max(t_s - 20.0, 0.0), 10.0 / 1.5)
        after = max(t_s - 20.0 - 10.0 / 1.5, 0.0)
        return 1.0 + 1.5 * up - 2.25 * (1.0 - math.exp(-up / 1.5)) * math.exp(-after / 1.5)

    found = run(late)
    error = found.error + np.array([late(t) - lift(t) for t in found.t.tolist()])
    assert np.abs(error / found.std).max() < 5.0


def test_air_that_is_not_that_of_the_standard_atmosphere_is_part_of_the_standard_deviation() -> None:
    hot = run(lift, air=AIR + 20.0, noise=0.05, drift=0.0)
    assert hot.error[-1] == pytest.approx(-10.0 * 20.0 / AIR, abs=0.25)
    assert abs(hot.error[-1]) < 2.0 * hot.std[-1]


def with_reference(weather: Height, until_s: float, dies_s: float) -> tuple[Array, Array]:
    """Return NODE of each second of a level tag beside a reference, and the heights."""
    heights = tags()
    heights["reference"][TAG] = REFERENCE
    nodes = []
    for t_s in np.arange(0.0, until_s, 0.2).tolist():
        at, shown = T0 + round(t_s * 1e9), weather(t_s)
        if t_s < dies_s:
            add_pressure(heights[REFERENCE], at, pressure(3.0 + shown + 7.0), math.nan)  # its sensor is 7 m off
        share_references(heights, np.array([TAG]))
        add_pressure(heights[TAG], at, pressure(1.0 + shown - 4.0), math.nan)
        nodes.append(read(heights, t_s))
    return np.array(nodes)[::5], heights


def test_a_reference_takes_the_weather_out() -> None:
    nodes, _ = with_reference(lambda t_s: 0.03 * t_s, 300.0, dies_s=300.0)  # 9 m: 1 hPa in five minutes
    assert np.abs(nodes["height"] - 1.0).max() < 0.3
    alone = run(level, noise=0.0, drift=0.0)
    assert nodes["height_std"][55] < alone.std[550]


def test_a_reference_that_dies_keeps_its_last_level_and_the_height_widens() -> None:
    living, _ = with_reference(lambda _: 5.0, 600.0, dies_s=600.0)
    dead, _ = with_reference(lambda _: 5.0, 600.0, dies_s=120.0)
    assert np.abs(np.diff(dead["height"])).max() < 0.1
    assert dead["height"][-1] == pytest.approx(1.0, abs=0.3)
    assert dead["height_std"][100] == pytest.approx(living["height_std"][100])
    assert dead["height_std"][-1] > 2.0 * living["height_std"][-1]


def test_a_height_without_pressures_is_unknown_up_to_its_bound() -> None:
    heights, stds = tags(HeightMotion.FREE), []
    for t_s in (0.0, 1.0, 10.0, 60.0, 4_000.0, 100_000.0):
        node = read(heights, t_s)
        assert (node["height"], node["height_source"]) == (1.0, UNKNOWN)
        stds.append(float(node["height_std"]))
    assert stds == sorted(stds)
    assert stds[0] == pytest.approx(HEIGHT_STD)
    assert stds[-1] == pytest.approx(HEIGHT_BOUND)


def test_only_a_tag_that_is_told_nothing_follows_the_first_pressure() -> None:
    auto, flat = tags(), tags(HeightMotion.FLAT)
    assert read(auto, 0.0)["height_std"] == 0.0
    assert add_pressure(auto[TAG], T0, LOW, math.nan) == ACCEPTED
    assert read(auto, 0.0)["height_source"] == BY_PRESSURE
    assert add_pressure(flat[TAG], T0, LOW, math.nan) == UNUSED
    assert read(flat, 0.0)["height_std"] == 0.0


def test_a_pressure_from_before_the_last_one_does_no_harm() -> None:
    heights = tags()
    for t_s in (10.0, 9.0, 10.1):
        assert add_pressure(heights[TAG], T0 + round(t_s * 1e9), LOW, math.nan) == ACCEPTED
    node = read(heights, 10.2)
    assert node["height"] == pytest.approx(1.0, abs=0.01)
    assert np.isfinite(heights["P"][TAG]).all()
    assert np.linalg.eigvalsh(heights["P"][TAG]).min() > -1e-12
