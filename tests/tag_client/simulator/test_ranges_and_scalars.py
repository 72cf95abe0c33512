"""Ranges and scalar sensors have exactly the noise of their settings."""

from dataclasses import replace

import numpy as np
import pytest

from dropanchor_tag_client.simulator.noise import gauss_markov
from dropanchor_tag_client.simulator.perturbations import PERTURBATIONS, perturbed
from dropanchor_tag_client.simulator.ranging import AnchorPlace, RangeModel
from dropanchor_tag_client.simulator.scalar import wrapped
from dropanchor_tag_client.simulator.sensors import PRESETS, SensorModels, noiseless, preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from dropanchor_tag_client.simulator.trajectory import Array


def range_errors(run: Simulation, height: float = 0.0) -> Array:
    x, y = (np.interp(run.ranges.t_s, run.truth.t_s, column) for column in (run.truth.x, run.truth.y))
    places = np.array([anchor[1:] for anchor in run.anchors])[run.ranges.anchor]
    away = np.column_stack([x, y, np.full(len(x), height)]) - places
    return np.asarray(run.ranges.range_m - np.sqrt((away**2).sum(axis=1)))


def heading_errors(run: Simulation) -> Array:
    return wrapped(run.scalars.heading_rad - run.truth.heading)


def pooled(names: tuple[str, ...], seeds: range = range(12)) -> list[Simulation]:
    models = perturbed(PRESETS["paper"], *names)
    return [simulate("M5", seed, models) for seed in seeds]


@pytest.mark.parametrize("names", [(), ("nlosburst", "drop20"), ("hcorr", "magdist", "gdrift", "late15")])
def test_the_same_seed_gives_the_same_numbers(names: tuple[str, ...]) -> None:
    first, again = (simulate("M5", 5, perturbed(PRESETS["real"], *names)) for _ in range(2))
    for group in ("truth", "imu", "ranges", "scalars"):
        for one, other in zip(getattr(first, group), getattr(again, group), strict=True):
            assert np.array_equal(one, other)


def test_changing_one_sensor_does_not_change_the_others() -> None:
    plain, perturbed_ranges = simulate("S5", 2), simulate("S5", 2, perturbed(SensorModels(), "nlos10", "drop20"))
    assert np.array_equal(plain.scalars.heading_rad, perturbed_ranges.scalars.heading_rad)
    assert np.array_equal(plain.imu.acc, perturbed_ranges.imu.acc)


@pytest.mark.parametrize(("name", "range_std", "heading_std"), [("paper", 0.2, 0.1), ("real", 0.1, 0.05)])
def test_white_noise_has_the_size_of_its_preset(name: str, range_std: float, heading_std: float) -> None:
    runs = [simulate("S5", seed, PRESETS[name]) for seed in range(8)]
    ranges = np.concatenate([range_errors(run) for run in runs])
    headings = np.concatenate([heading_errors(run) for run in runs])
    assert ranges.std() == pytest.approx(range_std, rel=0.05)
    assert abs(ranges.mean()) < 5 * range_std / np.sqrt(len(ranges))
    assert headings.std() == pytest.approx(heading_std, rel=0.05)
    assert abs(np.corrcoef(ranges[1:], ranges[:-1])[0, 1]) < 0.05


def test_real_ranges_come_ten_times_a_second() -> None:
    assert np.diff(simulate("S5", 0, PRESETS["real"]).ranges.t_s) == pytest.approx(0.1)


def test_the_paper_s_run_has_a_range_at_every_one_of_its_instants() -> None:
    run = simulate("P", 0)
    assert run.ranges.t_s == pytest.approx(run.truth.t_s)
    assert len(run.ranges.t_s) == 10_001


def test_sensors_without_noise_measure_the_truth() -> None:
    run = simulate("M5", 4, noiseless())
    assert range_errors(run) == pytest.approx(np.zeros(len(run.ranges.t_s)), abs=1e-4)
    assert heading_errors(run) == pytest.approx(np.zeros(len(run.truth.t_s)), abs=1e-9)
    dt = 0.01
    assert np.cumsum(run.scalars.gyro_radps) * dt == pytest.approx(run.truth.course - run.truth.course[0], abs=1e-9)
    assert np.cumsum(run.scalars.acceleration_mps2) * dt == pytest.approx(run.truth.v, abs=1e-9)


def test_scalar_gyro_and_acceleration_have_their_noise_and_biases() -> None:
    gyro_bias, white, at_rest = [], [], []
    for seed in range(60):
        run, exact = simulate("S5", seed), simulate("S5", seed, noiseless())
        error = run.scalars.gyro_radps - exact.scalars.gyro_radps
        gyro_bias.append(error.mean())
        white.append(np.diff(run.scalars.acceleration_mps2 - exact.scalars.acceleration_mps2)[200:].std() / np.sqrt(2))
        at_rest.append(np.diff(run.scalars.acceleration_mps2[:95]).std() / np.sqrt(2))
        assert error.std() == pytest.approx(0.02, rel=0.05)
    assert np.std(gyro_bias) == pytest.approx(0.01, rel=0.25)
    assert np.mean(white) == pytest.approx(0.1, rel=0.03)
    assert np.mean(at_rest) == pytest.approx(0.02, rel=0.05)


def test_a_gauss_markov_process_is_stationary_with_its_correlation_time() -> None:
    rng = np.random.default_rng(1)
    x = gauss_markov(rng, 400_000, 0.01, 0.5, 0.3, 0.0)
    lagged = np.corrcoef(x[30:], x[:-30])[0, 1]
    assert x.std() == pytest.approx(0.5, rel=0.05)
    assert lagged == pytest.approx(np.exp(-1), abs=0.03)
    steps = x[1:] - np.exp(-0.01 / 0.3) * x[:-1]
    assert steps.std() == pytest.approx(0.5 * np.sqrt(1 - np.exp(-0.02 / 0.3)), rel=0.02)
    assert np.abs(steps).max() < 6 * steps.std()


def test_ranges_are_slant_and_name_their_anchor() -> None:
    anchors = (AnchorPlace("A", 0, 0, 2.5), AnchorPlace("B", 5, -3, 0.0), AnchorPlace("C", 30, 8, 1.0))
    models = replace(noiseless(), anchors=anchors, height_m=1.2, ranges=RangeModel(hz=10.0, std=0.0))
    run = simulate("S5", 0, models)
    assert range_errors(run, height=1.2) == pytest.approx(np.zeros(len(run.ranges.t_s)), abs=1e-4)
    assert run.ranges.anchor[:6].tolist() == [0, 1, 2, 0, 1, 2]
    assert np.diff(run.ranges.t_s[:30]) == pytest.approx(np.full(29, 1 / 30))


def test_bias_scale_and_delay_are_as_set() -> None:
    exact = simulate("S5", 1, replace(noiseless(), ranges=RangeModel(std=0.0)))
    off = simulate("S5", 1, replace(noiseless(), ranges=RangeModel(std=0.0, bias=-0.2, scale=1.07, delay_s=0.05)))
    assert off.ranges.range_m[5:] == pytest.approx(1.07 * exact.ranges.range_m[:-5] - 0.2, abs=1e-6)


def test_ten_percent_of_the_ranges_are_too_long_by_half_a_metre_or_more() -> None:
    errors = np.concatenate([range_errors(run) for run in pooled(("nlos10",))])
    assert errors.mean() == pytest.approx(0.1 * 1.15, rel=0.1)
    assert (errors > 0.9).mean() == pytest.approx(0.1 * 1.1 / 1.7, rel=0.1)
    assert (errors < -0.9).mean() == 0.0


def test_bursts_hold_one_excess_for_one_to_three_seconds() -> None:
    models = replace(noiseless(), ranges=RangeModel(std=0.0, burst_count=4))
    for seed in range(10):
        run = simulate("M5", seed, models)
        nlos = range_errors(run) > 0.1
        assert 1.0 <= nlos.mean() * (run.truth.t_s[-1] - run.truth.t_s[0]) <= 12.1
        assert 1 <= len(np.unique(np.round(range_errors(run)[nlos], 2))) <= 8


def test_a_fifth_of_the_ranges_is_lost() -> None:
    runs = pooled(("drop20",))
    received = sum(len(run.ranges.t_s) for run in runs) / sum(len(run.truth.t_s) for run in runs)
    assert received == pytest.approx(0.8, abs=0.01)


def test_an_outage_lasts_five_seconds() -> None:
    for run in pooled(("outage5",), range(5)):
        gaps = np.diff(run.ranges.t_s)
        assert gaps.max() == pytest.approx(5.0, abs=0.03)
        assert np.count_nonzero(gaps > 0.02) == 1


@pytest.mark.parametrize(("name", "bias"), [("hb0.1", 0.1), ("hb0.2", 0.2)])
def test_a_heading_bias_is_constant(name: str, bias: float) -> None:
    errors = heading_errors(pooled((name,), range(1))[0])
    assert errors.mean() == pytest.approx(bias, abs=0.01)
    assert errors.std() == pytest.approx(0.1, rel=0.05)


def test_heading_drift_is_a_sine_of_forty_seconds() -> None:
    run = pooled(("hdrift",), range(1))[0]
    assert heading_errors(run) - 0.2 * np.sin(2 * np.pi * run.truth.t_s / 40) == pytest.approx(0.0, abs=0.5)
    assert heading_errors(run)[900:1100].mean() == pytest.approx(0.2, abs=0.02)
    assert heading_errors(run)[2900:3100].mean() == pytest.approx(-0.2, abs=0.02)


def test_a_correlated_heading_error_replaces_the_white_one() -> None:
    errors = [heading_errors(run) for run in pooled(("hcorr",), range(40))]
    assert np.concatenate(errors).std() == pytest.approx(0.1, rel=0.1)
    assert np.mean([np.corrcoef(e[300:], e[:-300])[0, 1] for e in errors]) == pytest.approx(np.exp(-1), abs=0.15)
    assert max(np.abs(np.diff(e)).max() for e in errors) < 0.06


def test_gyro_drift_moves_the_gyro_by_two_degrees_a_second() -> None:
    plain, drifting = pooled((), range(1))[0], pooled(("gdrift",), range(1))[0]
    scalar = drifting.scalars.gyro_radps - plain.scalars.gyro_radps
    raw = drifting.imu.gyro[:, 2] - plain.imu.gyro[:, 2]
    assert scalar.max() == pytest.approx(0.03, rel=0.01)
    assert raw == pytest.approx(scalar, abs=1e-9)


def test_a_late_tag_sends_its_first_sample_fifteen_seconds_into_its_motion() -> None:
    run = pooled(("late15",), range(1))[0]
    for times in (run.truth.t_s, run.imu.t_s, run.ranges.t_s, run.scalars.t_s):
        assert times[0] == pytest.approx(16.01)
    assert run.truth.v[0] > 0


def test_the_combination_applies_all_its_parts() -> None:
    run = pooled(("combo",), range(1))[0]
    assert heading_errors(run).mean() == pytest.approx(0.1, abs=0.01)
    assert np.diff(run.ranges.t_s).max() == pytest.approx(5.0, abs=0.1)
    assert len(run.ranges.t_s) / len(run.truth.t_s) == pytest.approx(0.8 * (1 - 5 / run.truth.t_s[-1]), abs=0.03)
    assert (range_errors(run) > 0.9).mean() > 0.03


@pytest.mark.parametrize("name", PERTURBATIONS)
def test_every_perturbation_changes_something(name: str) -> None:
    assert perturbed(SensorModels(), name) != SensorModels()


def test_an_unknown_name_is_an_error_that_lists_the_valid_names() -> None:
    with pytest.raises(ValueError, match=r"no perturbation 'rain'; there are nlos10"):
        perturbed(SensorModels(), "rain")
    with pytest.raises(ValueError, match=r"no noise 'loud'; there are paper"):
        preset("loud")


def test_rates_can_be_set() -> None:
    run = simulate("S5", 0, preset("real", range_hz=5.0, imu_hz=50.0))
    assert np.diff(run.ranges.t_s) == pytest.approx(0.2)
    assert np.diff(run.imu.t_s) == pytest.approx(0.02)


def test_the_level_imu_of_a_turned_body_has_the_axes_of_its_heading() -> None:
    straight = simulate("M5", 5000, noiseless())
    turned = simulate("M5", 5000, replace(noiseless(), mount_rad=0.6))
    along, left = straight.level_imu().acc[:, 0], straight.level_imu().acc[:, 1]
    expected = np.column_stack([np.cos(0.6) * along - np.sin(0.6) * left, np.sin(0.6) * along + np.cos(0.6) * left])
    np.testing.assert_allclose(turned.level_imu().acc[:, :2], expected, atol=1e-9)
    assert np.abs(expected[:, 1] - left).max() > 0.5


def test_the_left_axis_of_a_level_imu_is_what_turns_the_speed_along_the_course() -> None:
    run = simulate("P", 5000, noiseless())
    dt, imu = float(run.truth.t_s[1] - run.truth.t_s[0]), run.level_imu()
    np.testing.assert_allclose(imu.acc[1:, 1] * dt, run.truth.v[1:] * imu.gyro[1:, 2] * dt, atol=1e-9)
