"""A recording with a fault is replayed right, or `dropanchor replay` says what is wrong with it."""

import math
from pathlib import Path

import pytest

from dropanchor_tag_client.simulator.simulation import Simulation
from service.commands.replays import (
    call,
    read_rows,
    start_of,
    times,
    write_changed,
    write_rows,
    wrong_while_tracking,
    yard,
)

UNIX_S = 1_700_000_000


@pytest.fixture(scope="module")
def run() -> Simulation:
    return yard()


@pytest.fixture(scope="module")
def good(run: Simulation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the poses of the recording without a fault."""
    folder = tmp_path_factory.mktemp("good")
    ended = call(write_changed(run, folder), start_of(run), "--out", folder / "poses.csv")
    assert ended.status == 0
    assert "'s clock is" not in ended.out
    tracking, wrong = wrong_while_tracking(folder / "poses.csv", run)
    assert tracking > 500
    assert wrong == 0
    return folder / "poses.csv"


def places(poses: Path) -> list[float]:
    return [float(row[name] or "nan") for row in read_rows(poses) for name in ("x", "y")]


@pytest.mark.parametrize(
    ("start_s", "per_second", "said"),
    [
        (UNIX_S, 1, ""),
        (-1_000, 1, ""),
        (0, 1_000, "t_s holds milliseconds"),
        (UNIX_S, 1_000_000, "t_s holds microseconds"),
        (UNIX_S, 1_000_000_000, "t_s holds nanoseconds"),
    ],
)
def test_times_of_any_unit_and_since_any_instant_give_the_same_poses(
    run: Simulation, good: Path, tmp_path: Path, start_s: int, per_second: int, said: str
) -> None:
    def clock(t: float) -> object:
        return start_s + t if per_second == 1 else start_s * per_second + round(t * per_second)

    folder = write_changed(run, tmp_path / "r", range=times(clock), imu=times(clock))
    ended = call(folder, start_of(run), "--out", tmp_path / "poses.csv")
    assert ended.status == 0
    assert said in ended.out
    assert float(read_rows(tmp_path / "poses.csv")[0]["t_s"]) == pytest.approx(start_s, abs=1e-3)
    assert places(tmp_path / "poses.csv") == pytest.approx(places(good), abs=0.2)  # times of floats


def test_a_truth_on_another_clock_is_named(run: Simulation, tmp_path: Path) -> None:
    later = times(lambda t: UNIX_S + t)
    ended = call(write_changed(run, tmp_path / "r", range=later, imu=later), start_of(run))
    assert "no accuracy: the truth has no time in common with the poses" in ended.out


def test_a_clock_that_is_set_back_ends_with_the_line(run: Simulation, tmp_path: Path) -> None:
    back = times(lambda t: t - 5 if t > 60 else t)
    ended = call(write_changed(run, tmp_path / "r", range=back, imu=back), start_of(run))
    assert ended.status == 2
    assert "range.csv line 603: the time goes back by 4.9 s" in ended.error
    assert "split it there into two recordings, or add 4.9 s" in ended.error


def test_whole_seconds_are_named_with_their_count(run: Simulation, tmp_path: Path) -> None:
    whole = times(math.floor)
    folder = write_changed(run, tmp_path / "r", range=whole, imu=whole)
    ended = call(folder, start_of(run), "--out", tmp_path / "poses.csv")
    assert "several samples have the same time: 5,000 of 5,001 IMU samples share" in ended.out
    assert wrong_while_tracking(tmp_path / "poses.csv", run)[1] == 0


@pytest.mark.parametrize("ahead_s", [2.0, 0.5, -2.0])
def test_an_imu_on_another_clock_is_corrected_and_that_is_said(run: Simulation, tmp_path: Path, ahead_s: float) -> None:
    folder = write_changed(run, tmp_path / "r", imu=times(lambda t: t + ahead_s))
    ended = call(folder, start_of(run), "--out", tmp_path / "poses.csv")
    direction = "ahead of" if ahead_s > 0 else "behind"
    assert f"s {direction} the ranges': corrected; --clock-offset 0 switches this off" in ended.out
    tracking, wrong = wrong_while_tracking(tmp_path / "poses.csv", run)
    assert tracking > 500
    assert wrong == 0


def test_the_clock_offset_can_be_given_or_switched_off(run: Simulation, good: Path, tmp_path: Path) -> None:
    folder = write_changed(run, tmp_path / "r", imu=times(lambda t: t + 2.0))
    given = call(folder, start_of(run), "--clock-offset=2", "--out", tmp_path / "poses.csv")
    assert "the IMU's clock is 2.0 s ahead of the ranges': moved as --clock-offset 2 says" in given.out
    assert places(tmp_path / "poses.csv") == pytest.approx(places(good), abs=1e-3)
    off = call(folder, start_of(run), "--clock-offset=0", "--out", tmp_path / "poses.csv")
    assert "'s clock is" not in off.out
    assert places(tmp_path / "poses.csv") != pytest.approx(places(good), abs=0.1)


def test_zeros_of_a_radio_that_fails_do_no_harm(run: Simulation, tmp_path: Path) -> None:
    folder = write_changed(run, tmp_path / "r")
    rows = read_rows(folder / "range.csv")
    for row in rows[::7]:
        row["range_m"] = "0.0"
    write_rows(folder / "range.csv", rows)
    assert call(folder, start_of(run), "--out", tmp_path / "poses.csv").status == 0
    assert wrong_while_tracking(tmp_path / "poses.csv", run)[1] == 0


def test_values_that_no_sensor_measures_are_left_out_and_counted_with_the_first_line(
    run: Simulation, tmp_path: Path
) -> None:
    folder = write_changed(run, tmp_path / "r")
    ranges, imu = read_rows(folder / "range.csv"), read_rows(folder / "imu.csv")
    for value, row in zip(["5000", "5000", "nan", "-1"], ranges[100:], strict=False):
        row["range_m"] = value
    for std, row in zip(["0", "-0.1"], ranges[200:], strict=False):
        row["std_m"] = std
    imu[50]["ax"] = "1e9"
    write_rows(folder / "range.csv", ranges)
    write_rows(folder / "imu.csv", imu)
    said = call(folder, start_of(run)).out.split("not used: ")[1].strip()
    assert said == (
        "1 imu_absurd (first: imu.csv line 52), 1 not_finite (first: range.csv line 104), "
        "2 range_absurd (first: range.csv line 102), 1 range_negative (first: range.csv line 105), "
        "2 std_invalid (first: range.csv line 202)"
    )


def test_ranges_that_are_all_unusable_are_an_error_that_says_why(run: Simulation, tmp_path: Path) -> None:
    ended = call(write_changed(run, tmp_path / "r", range=lambda row: row.update(std_m="0")))
    assert ended.status == 2
    assert "no usable range to this anchor; not used: 1,001 std_invalid (first: range.csv line 2)" in ended.error
