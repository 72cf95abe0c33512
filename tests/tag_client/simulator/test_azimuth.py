"""Azimuths of a simulated anchor: where it faces, its errors, its field of view, and what it cannot tell."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dropanchor_tag_client.simulator.azimuth import AzimuthModel, Azimuths
from dropanchor_tag_client.simulator.live import deliveries
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate

EXACT = AzimuthModel(std=0.0)


def measured(model: AzimuthModel, seed: int = 48_900) -> tuple[Simulation, Azimuths]:
    run = simulate("OU", seed, replace(preset("none", range_hz=10.0), azimuth=model))
    assert run.azimuths is not None
    return run, run.azimuths


def true_of(run: Simulation, azimuths: Azimuths) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    x, y = (np.interp(azimuths.t_s, run.truth.t_s, column) for column in (run.truth.x, run.truth.y))
    return np.arctan2(y, x)


def test_each_range_has_the_azimuth_from_where_the_anchor_faces() -> None:
    run, azimuths = measured(replace(EXACT, facing=1.0))
    assert np.array_equal(azimuths.t_s, run.ranges.t_s)
    turned = np.remainder(azimuths.azimuth_rad + 1.0 - true_of(run, azimuths) + 1.0, math.tau) - 1.0
    assert turned == pytest.approx(0.0, abs=0.02)


def test_white_noise_and_lasting_errors_are_as_large_as_told() -> None:
    run, azimuths = measured(AzimuthModel(std=0.05, lasting=0.1))
    errors = np.remainder(azimuths.azimuth_rad - true_of(run, azimuths) + math.pi, math.tau) - math.pi
    assert 0.05 < np.std(errors) < 0.12
    assert azimuths.std_rad == pytest.approx(math.hypot(0.05, 0.1))
    assert np.corrcoef(errors[1:], errors[:-1])[0, 1] > 0.3  # they last


def test_beyond_its_field_it_sees_nothing_and_behind_it_the_mirror_image_ahead() -> None:
    run, azimuths = measured(replace(EXACT, field=1.0))
    assert 0 < len(azimuths.t_s) < len(run.ranges.t_s)
    assert np.abs(azimuths.azimuth_rad).max() <= 1.0
    run, folded = measured(replace(EXACT, is_folded=True))
    assert np.abs(folded.azimuth_rad).max() <= math.pi / 2
    assert np.sin(folded.azimuth_rad) == pytest.approx(np.sin(true_of(run, folded)), abs=0.02)


def test_azimuths_change_no_other_sample_and_a_live_tag_sends_them() -> None:
    plain = simulate("OU", 48_901, preset("calibrated"))
    run = simulate("OU", 48_901, replace(preset("calibrated"), azimuth=EXACT))
    assert np.array_equal(plain.ranges.range_m, run.ranges.range_m)
    assert np.array_equal(plain.imu.acc, run.imu.acc)
    models = replace(preset("calibrated", imu_hz=50.0), azimuth=EXACT)
    parts = [part for part, _ in zip(deliveries(1, "yard", 48_902, models, 0), range(100), strict=False)]
    assert sum(len(part.bearings) for part in parts) == sum(len(part.ranges) for part in parts) > 10
