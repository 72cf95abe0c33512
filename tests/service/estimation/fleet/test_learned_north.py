"""A track that began with a told heading learns where north is, and goes on when the site's declination changes."""

import math
from dataclasses import replace

import numpy as np

from dropanchor_evaluation.simulated import batches, merged, samples_of
from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.estimation.columns import Array, anchors_at
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.settings.engine_columns import tag_columns
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate

OFF = 2.2  # rad, of the site's axes
SECONDS = 50.0


def rooms(tags: int) -> list[Simulation]:
    """Return runs in a place where the field points elsewhere."""
    models = preset("calibrated", imu_hz=50.0)
    turned = replace(models, imu=replace(models.imu, declination_rad=OFF))
    return [simulate("S5", seed, turned) for seed in range(5000, 5000 + tags)]


def engine_for(runs: list[Simulation], place: bool = True, heading: bool = True) -> FleetEngine:
    """Return an engine for tags whose place, and whose heading there, are told or not."""
    engine = FleetEngine()
    engine.set_anchors(anchors_at(*((a.x, a.y, a.z) for a in runs[0].anchors)))
    for row, run in enumerate(runs):
        truth = run.truth
        yaw = math.remainder(truth.heading[0], math.tau) if heading else None
        start = StartPose(x=truth.x[0], y=truth.y[0], heading_rad=yaw) if place else None
        settings = TagSettings(start=start, height_m=truth.z[0], magnetometer_calibrated=True)
        engine.configure(row, tag_columns(settings, 0.0))
    return engine


def poses_of(engine: FleetEngine, runs: list[Simulation], turned_at_s: float = math.inf) -> Array:
    """Return the poses over the first seconds. turned_at_s: when the site gets the right declination."""
    samples = merged([samples_of(run, "raw", row=row) for row, run in enumerate(runs)])
    found = []
    for step, batch in zip(range(round(SECONDS / 0.2)), batches(samples, 0.2), strict=False):
        if step * 0.2 <= turned_at_s < (step + 1) * 0.2:
            assert all(engine.turn_north(row, OFF) for row in range(len(runs)))
        found.append(engine.process(batch).poses)
    return np.concatenate(found)


def test_tracks_with_a_told_heading_learn_where_north_is_within_what_they_claim() -> None:
    runs = rooms(4)
    engine = engine_for(runs)
    poses_of(engine, runs)
    norths = engine.norths(np.arange(len(runs)))
    assert len(norths) == len(runs)
    errors = np.array([math.remainder(one, math.tau) for one in norths["declination"] - OFF])
    assert np.all(np.abs(errors) < 3.0 * norths["std"])
    assert np.abs(errors).max() < 0.2
    assert norths["std"].max() < 0.3


def test_a_start_without_a_heading_and_no_start_tell_nothing() -> None:
    runs = rooms(2)
    for place in (True, False):
        engine = engine_for(runs, place=place, heading=False)
        poses_of(engine, runs)
        assert not len(engine.norths(np.arange(2)))


def test_before_the_first_sample_nothing_is_known() -> None:
    assert not len(engine_for(rooms(1)).norths(np.array([0])))


def test_a_track_that_knows_north_goes_on_unchanged_under_another_declination() -> None:
    runs = rooms(2)
    before, after = engine_for(runs), engine_for(runs)
    left, right = poses_of(before, runs), poses_of(after, runs, turned_at_s=45.0)
    for name in ("x", "y", "heading", "sigma_pos"):
        np.testing.assert_allclose(left[name], right[name], atol=1e-9, equal_nan=True)
    np.testing.assert_allclose(before.norths(np.arange(2))["std"], after.norths(np.arange(2))["std"], atol=1e-9)


def test_a_track_without_a_told_heading_does_not_go_on_under_another_declination() -> None:
    runs = rooms(1)
    assert not engine_for(runs, place=False).turn_north(0, OFF)
