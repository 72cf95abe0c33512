"""The check of the sensors names what is wrong with them, and finds nothing where nothing is."""

import csv
import gzip
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from dropanchor_service.estimation.columns import IMU, RANGE, Array, SampleBatch, State, StateReason
from dropanchor_service.estimation.plausibility.check import SensorCheck
from dropanchor_service.estimation.plausibility.recorded import findings_of
from support.imu import synthesise
from support.recordings import recording_or_skip
from support.sensor_faults import (
    FAULTS,
    GRAVITY,
    T0_NS,
    beyond,
    cut,
    of_imu,
    run_of,
    samples_of,
    tracked,
    verdicts_of,
)

SCENARIOS = ("S5", "M5", "C5", "OU", "L1", "SG", "RV", "rolling", "forklift", "hand", "pocket", "turned")
RECORDINGS = (
    *("cf_circle_xy", "cf_sine_xyz", "hanyang_losB4", "hanyang_nlosA2", "iasl_s1", "iasl_s3", "inrol_1", "inrol_2"),
    *("mower", "plaza2", "rtt_canteen_2_213", "rtt_laboratory_1_113", "rtt_library_2_213"),
    *("starloc_fast_s1_tag1", "starloc_fast_s1_tag2", "tiers_B", "tiers_D"),
    *(f"phones/ms0{walk}_{how}" for walk in range(8) for how in ("front", "rot", "turn")),
    *("ipin_01", "ipin_03", "ipin_22"),  # begin with figures of eight
)


UNSEEN = "reversed accelerations without a field"  # an arm that swings is a turn to the inside, which settles the sign


def started(rows: int = 1) -> SensorCheck:
    """Return a check of tags that have sent nothing."""
    check = SensorCheck()
    for row in range(rows):
        check.start(row)
    return check


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("scenario", ["M5", "OU", "forklift"])
def test_each_fault_is_named(fault: str, scenario: str) -> None:
    imu, ranges = samples_of(run_of(scenario, 47_000))
    change, names = FAULTS[fault]
    change(imu, ranges)
    assert verdicts_of(imu, ranges).found[-1][1] == names


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("noise", ["calibrated", "real", "released", "paper"])
def test_good_sensors_get_no_verdict(scenario: str, noise: str) -> None:
    for seed in range(47_100, 47_103):
        assert verdicts_of(*samples_of(run_of(scenario, seed, noise))).found == []


@pytest.mark.parametrize("name", RECORDINGS)
def test_no_recording_gets_a_verdict(name: str) -> None:
    folder = recording_or_skip(name)
    imu, of_anchors = _imu(folder), _ranges(folder)
    for ranges in of_anchors:
        assert verdicts_of(imu if len(imu) else _still(ranges), ranges).found == []


@pytest.mark.parametrize("fault", FAULTS)
def test_a_tag_whose_sensors_are_wrong_is_never_far_off_while_tracking(fault: str) -> None:
    run = run_of("OU", 47_200)
    imu, ranges = samples_of(run)
    FAULTS[fault][0](imu, ranges)
    checked = tracked(imu, ranges, run, start_known=False)
    assert beyond(checked.poses, run)[1] == 0
    assert checked.poses[-1]["reason"] == StateReason.SENSOR_FAULT


@pytest.mark.parametrize("fault", FAULTS)
def test_a_told_start_is_believed_until_the_first_turns_at_most(fault: str) -> None:
    """Axes and signs show in the first turn, and until then the told start and the ranges hold the track."""
    run = run_of("forklift", 47_200)
    imu, ranges = samples_of(run)
    FAULTS[fault][0](imu, ranges)
    checked = tracked(imu, ranges, run, start_known=True)
    assert beyond(checked.poses, run)[1] <= 200  # 20 s
    assert checked.poses[-1]["reason"] == StateReason.SENSOR_FAULT


def figures_of_eight(seed: int, seconds: float = 30.0) -> Array:
    """Return the IMU samples of a phone that is held, then swung in figures of eight as compasses are calibrated."""
    rng = np.random.default_rng(seed)
    hz, phase = rng.uniform(0.6, 1.1), rng.uniform(0.0, 2.0 * np.pi, 3)
    swing, arm = rng.uniform((0.6, 0.5, 0.9), (1.1, 1.0, 1.4)), rng.uniform((0.1, 0.03, 0.05), (0.2, 0.06, 0.12))
    w = 2.0 * np.pi * hz * np.array([1.0, 2.0, 1.0])
    motion = synthesise(
        np.arange(0.0, seconds, 0.01),
        lambda t: np.clip(t - 1.0, 0.0, 1.0)[:, None] * swing * np.sin(w * t[:, None] + phase),
        lambda t: np.clip(t - 1.0, 0.0, 1.0)[:, None] * -arm * w**2 * np.sin(w * t[:, None] + phase),
        field=(0.0, 20.0, -45.0),
    )
    imu = np.zeros(len(motion.t), IMU)
    imu["t_ns"] = T0_NS + np.round(motion.t * 1e9).astype(np.int64)
    for name, std in (("acc", 0.1), ("gyro", 0.01), ("mag", 0.5)):
        imu[name] = getattr(motion, name) + rng.normal(0.0, std, (len(imu), 3))
    return imu


@pytest.mark.parametrize("seed", range(48_000, 48_030))
def test_the_figure_of_eight_that_calibrates_a_compass_is_not_taken_for_a_broken_imu(seed: int) -> None:
    imu = figures_of_eight(seed)
    found = verdicts_of(imu, np.zeros(0, RANGE)).found  # the first swing may be judged, for a second
    assert not found or (len(found), found[-1][1]) == (2, set())
    assert not found or (found[-1][0] < 6.0 and found[-1][0] - found[0][0] < 1.1)
    assert "vigorous_motion" in [finding.name for finding in findings_of(SampleBatch(imu))]


@pytest.mark.parametrize("fault", [name for name in FAULTS if "ranges" not in name and name != UNSEEN])
def test_a_fault_shows_after_figures_of_eight_as_without_them(fault: str) -> None:
    walk, ranges = samples_of(run_of("forklift", 47_000))
    swung = figures_of_eight(47_321)
    walk["t_ns"] += swung["t_ns"][-1] + 10**7 - T0_NS
    imu = np.concatenate([swung, walk])
    change, names = FAULTS[fault]
    change(imu, ranges)
    assert verdicts_of(imu, ranges[:0]).found[-1][1] == names


def test_the_check_does_not_touch_a_tag_with_good_sensors() -> None:
    imu, ranges = samples_of(run_of("M5", 47_201))
    check = started()
    assert all(check.check(batch).samples is batch for batch in cut(imu, ranges, 0.2))


@pytest.mark.parametrize("fault", ["accelerations in g", "reversed accelerations", "rates about z, y, x"])
def test_a_fault_may_begin_and_end_within_a_run(fault: str) -> None:
    imu, ranges = samples_of(run_of("M5", 47_202))
    good = imu.copy()
    FAULTS[fault][0](imu, ranges)
    during = (imu["t_ns"] > T0_NS + 20 * 10**9) & (imu["t_ns"] < T0_NS + 45 * 10**9)
    imu[~during] = good[~during]
    found = verdicts_of(imu, ranges, step_s=0.5).found
    assert any(FAULTS[fault][1] <= names for _, names in found)
    assert 20.0 < found[0][0] < 45.0
    assert found[-1][1] == set()


def test_verdicts_do_not_depend_on_how_samples_are_cut_into_batches() -> None:
    imu, ranges = samples_of(run_of("forklift", 47_203))
    FAULTS["rates about z, y, x"][0](imu, ranges)
    checks = [started() for _ in range(3)]
    for check, step_s in zip(checks, (0.05, 0.7, 1000.0), strict=True):
        verdicts_of(imu, ranges, step_s, check)
    assert len({check.columns[:1].tobytes() for check in checks}) == 1


def test_a_neighbour_with_wrong_sensors_changes_nothing() -> None:
    imu, ranges = samples_of(run_of("M5", 47_204))
    wrong_imu, wrong_ranges = imu.copy(), ranges.copy()
    FAULTS["accelerations in g"][0](wrong_imu, wrong_ranges)
    wrong_imu["row"] = wrong_ranges["row"] = 1
    check = started(rows=2)
    kept = []
    for own, other in zip(cut(imu, ranges, 0.5), cut(wrong_imu, wrong_ranges, 0.5), strict=True):
        both = SampleBatch(np.concatenate([own.imu, other.imu]), np.concatenate([own.ranges, other.ranges]))
        kept.append(check.check(both).samples)
    assert np.concatenate([batch.imu[batch.imu["row"] == 0] for batch in kept]).tobytes() == imu.tobytes()
    assert not any((batch.imu["row"] == 1).any() for batch in kept[2:])


def test_a_tag_that_really_hangs_upside_down_is_no_fault() -> None:
    imu, ranges = samples_of(run_of("M5", 47_205))
    turned = of_imu(
        "acc", lambda v: v * (1, -1, -1), ("gyro", lambda v: v * (1, -1, -1)), ("mag", lambda v: v * (1, -1, -1))
    )
    turned(imu, ranges)
    assert verdicts_of(imu, ranges).found == []


def test_upside_down_without_a_field_is_doubted_until_turns_show_which_it_is() -> None:
    imu, ranges = samples_of(run_of("M5", 47_206))
    of_imu("acc", lambda v: v * (1, -1, -1), ("gyro", lambda v: v * (1, -1, -1)))(imu, ranges)
    imu["mag"] = np.nan
    assert [names for _, names in verdicts_of(imu, ranges).found] == [{"upside_down"}, set()]


def test_doubted_sensors_leave_the_pose_but_not_the_state() -> None:
    run = run_of("OU", 47_207)
    imu, ranges = samples_of(run)
    FAULTS["ranges that a module averages"][0](imu, ranges)
    poses = tracked(imu, ranges, run, start_known=True).poses
    last = poses[-100:]
    assert set(last["state"].tolist()) <= {State.DEGRADED, State.AMBIGUOUS, State.COASTING}
    assert np.isfinite(last["x"]).all()


def test_values_beyond_all_sensors_look_like_raw_counts() -> None:
    check = started()
    rows = np.zeros(30, np.int32)
    check.note_absurd(rows, np.full(30, 16384.0), rows[:0])
    (found,) = check.findings(0)
    assert found.name == "raw_counts"
    assert "16384" in found.sentence


def test_ranges_beyond_all_radios_look_like_millimetres() -> None:
    check = started()
    check.note_absurd(np.empty(0, np.int32), np.empty(0), np.zeros(20, np.int32))
    assert [found.setting for found in check.findings(0)] == [("range_unit", "mm")]


def test_a_verdict_that_was_restored_still_holds() -> None:
    imu, ranges = samples_of(run_of("M5", 47_208))
    FAULTS["accelerations in g"][0](imu, ranges)
    first, second = started(), started()
    batches = list(cut(imu, ranges, 1.0))
    for batch in batches[:5]:
        first.check(batch)
    second.columns = first.columns.copy()
    assert not any(len(column) for column in second.check(batches[5]).samples.columns())
    assert second.findings(0) == first.findings(0)


def test_samples_of_a_row_that_was_not_started_are_an_error() -> None:
    imu, ranges = samples_of(run_of("M5", 47_210))
    imu["row"][30:] = 1000
    with pytest.raises(IndexError, match="not started"):
        started().check(SampleBatch(imu[:50], ranges[:0]))


def test_a_sentence_says_what_to_multiply_by() -> None:
    imu, ranges = samples_of(run_of("M5", 47_209))
    FAULTS["accelerations in g"][0](imu, ranges)
    check = started()
    verdicts_of(imu, ranges, check=check)
    (found,) = check.findings(0)
    assert str(GRAVITY) in found.sentence
    assert found.setting == ("acc_unit", "g")


def _columns(path: Path) -> dict[str, tuple[str, ...]]:
    """Return the columns of a table by name. A row as a dictionary would take several times as long, 500 000 times."""
    with gzip.open(path, "rt") as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, zip(*rows, strict=True), strict=True))


def _t_ns(t_s: Sequence[str]) -> list[int]:
    return [round(float(one) * 1e9) + T0_NS for one in t_s]


def _imu(folder: Path) -> Array:
    path = folder / "imu.csv.gz"
    found = _columns(path) if path.exists() else {"t_s": ()}
    imu = np.zeros(len(found["t_s"]), IMU)
    imu["t_ns"] = _t_ns(found["t_s"])
    for name, columns in (("acc", "ax ay az"), ("gyro", "gx gy gz"), ("mag", "mx my mz")):
        for axis, column in enumerate(columns.split()):
            imu[name][:, axis] = [float(one or "nan") for one in found[column]] if column in found else np.nan
    return imu


def _ranges(folder: Path) -> Iterator[Array]:
    found = _columns(folder / "range.csv.gz")
    anchors, t_ns = np.array(found["anchor_id"]), np.array(_t_ns(found["t_s"]))
    range_m = np.array(found["range_m"], float)
    for anchor in np.unique(anchors):
        of_anchor = anchors == anchor
        ranges = np.zeros(of_anchor.sum(), RANGE)
        ranges["t_ns"], ranges["range"] = t_ns[of_anchor], range_m[of_anchor]
        yield ranges


def _still(ranges: Array) -> Array:
    """Return one IMU sample for a recording that has none."""
    imu = np.zeros(1, IMU)
    imu["t_ns"], imu["acc"] = ranges["t_ns"][0], (0.0, 0.0, GRAVITY)
    return imu
