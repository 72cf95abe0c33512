"""Ranges confirm starts that are right within seconds, and deny wrong ones, mostly before they are confirmed."""

import math

import numpy as np
import pytest

from dropanchor_evaluation.simulated import PriorKnowledge, batches, configure, merged, samples_of
from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.estimation.columns import ANCHOR, INNOVATION, POSE, MeasurementKind
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.ingest.kernels.starts import OPEN, follow_starts
from dropanchor_service.ingest.starts import StartWatch
from dropanchor_service.settings.engine_columns import tag_columns
from dropanchor_service.store.starts import StartNewsQueue, StartPhase
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate
from support.ingest import TransparentEngine

TAGS = 8
KNOWN = PriorKnowledge("raw 6-axis")
STEP_S = 0.2


def phases(off_m: float, turned_rad: float, seconds: float = 40.0) -> list[dict[StartPhase, float]]:
    """Return what becomes of the starts of driving tags, each with its time, s. off_m, turned_rad: their errors."""
    runs = [simulate("M5", seed, preset("calibrated", imu_hz=50.0)) for seed in range(9000, 9000 + TAGS)]
    engine, news = FleetEngine(), StartNewsQueue()
    watch = StartWatch(engine, news)
    configure(engine, runs, KNOWN)
    for row, run in enumerate(runs):
        settings = wrongly(run, off_m, turned_rad * (-1) ** row, row)
        engine.configure(row, tag_columns(settings, 0.0))
        watch.tell(row, settings, None)
    found: list[dict[StartPhase, float]] = [{} for _ in runs]
    samples = merged([samples_of(run, KNOWN.feed, KNOWN.heading_std, row) for row, run in enumerate(runs)])
    for step, batch in zip(range(round(seconds / STEP_S)), batches(samples, STEP_S), strict=False):
        watch.look(engine.process(batch))
        for one in news.take():
            found[one.row][one.phase] = step * STEP_S
    return found


def wrongly(run: Simulation, off_m: float, turned_rad: float, row: int) -> TagSettings:
    truth, way = run.truth, 2.0 * math.pi * row / TAGS
    start = StartPose(
        x=truth.x[0] + off_m * math.cos(way),
        y=truth.y[0] + off_m * math.sin(way),
        heading_rad=math.remainder(truth.heading[0] + turned_rad, math.tau),
        std_m=0.3,
    )
    mount = math.remainder(truth.course[0] - truth.heading[0], math.tau)
    return TagSettings(start=start, height_m=truth.z[0], mount_angle_rad=mount, heading_source="imu")


def test_a_right_start_is_confirmed_within_seconds_and_settled_after_a_way() -> None:
    found = phases(0.0, 0.0)
    delays = [one[StartPhase.CONFIRMED] for one in found]
    assert np.median(delays) <= 5.0
    assert max(delays) <= 12.0
    assert all(StartPhase.DENIED not in one for one in found)
    assert sum(StartPhase.SETTLED in one for one in found) >= TAGS // 2


def test_a_start_that_ranges_deny_was_hardly_ever_confirmed() -> None:
    found = [one for off_m, turned in ((20.0, 0.0), (10.0, 0.0), (2.0, math.pi)) for one in phases(off_m, turned, 30.0)]
    denied = [one for one in found if StartPhase.DENIED in one]
    assert len(denied) >= TAGS
    assert sum(StartPhase.CONFIRMED in one for one in denied) <= 0.2 * len(denied)


def test_an_engine_that_denies_no_start_leaves_nothing_to_wait_for() -> None:
    news = StartNewsQueue()
    watch = StartWatch(TransparentEngine(), news)
    watch.tell(0, TagSettings(start=StartPose(x=0.0, y=0.0)), None)
    assert not news.take()


def test_a_start_is_followed_until_the_settings_lose_it() -> None:
    news = StartNewsQueue()
    engine = FleetEngine()
    engine.set_anchors(np.zeros(1, ANCHOR))
    watch = StartWatch(engine, news)
    told = TagSettings(start=StartPose(x=1.0, y=2.0))
    for settings, earlier in ((told, None), (TagSettings(), told), (TagSettings(), TagSettings())):
        engine.configure(0, tag_columns(settings, 0.0))
        watch.tell(0, settings, earlier)
    watch.end(0)  # nothing is open
    places = [(one.phase, bool(one.place), bool(one.before)) for one in news.take()]
    assert places == [
        (StartPhase.TOLD, True, False),
        (StartPhase.TOLD, False, True),
    ]


def test_a_start_that_the_engine_no_longer_follows_after_a_restart_is_at_an_end() -> None:
    engine, news = FleetEngine(), StartNewsQueue()
    settings = TagSettings(start=StartPose(x=1.0, y=2.0, heading_rad=0.0, std_m=0.3))
    engine.configure(0, tag_columns(settings, 0.0))
    engine.configure(1, tag_columns(TagSettings(), 0.0))  # as one that has left its start
    watch = StartWatch(engine, news)
    for row in (0, 1):
        watch.resume(row, settings)
    assert [(one.row, one.phase) for one in news.take()] == [(0, StartPhase.RESUMED), (1, StartPhase.ENDED)]


def test_a_row_that_an_earlier_process_had_tells_that_its_settings_have_no_start_now() -> None:
    news = StartNewsQueue()
    StartWatch(FleetEngine(), news).tell(0, TagSettings(), None)
    assert [(one.phase, one.place) for one in news.take()] == [(StartPhase.TOLD, "")]


def test_ranges_of_one_instant_share_what_the_last_of_them_says() -> None:
    poses, innovations, starts = np.zeros(5, POSE), np.zeros(4, INNOVATION), np.zeros(3, OPEN)
    poses["row"], poses["t_ns"], poses["speed"] = [2, 0, 0, 0, 1], [1, 1, 300_000_001, 300_000_001, 1], 2.0
    innovations["row"], innovations["t_ns"] = [2, 0, 0, 0], [1, 1, 300_000_001, 300_000_001]
    innovations["S"], innovations["fused"], innovations["innovation"] = 1.0, True, [0.0, 0.0, 9.0, 1.0]
    innovations["kind"] = MeasurementKind.RANGE
    starts["is_open"] = [True, False, True]
    rows = np.zeros(len(poses), np.int64)
    assert follow_starts(poses, innovations, starts, rows) == (2, False)
    assert rows[:2].tolist() == [2, 0]
    assert starts["agreed_s"].tolist() == pytest.approx([0.3, 0.0, 0.0])
    assert starts["agreed_m"].tolist() == pytest.approx([0.6, 0.0, 0.0])
    assert starts["last_ns"].tolist() == [300_000_001, 0, 1]
