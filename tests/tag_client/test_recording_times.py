"""The times of a recording are read in the unit that they are in, and a clock that goes wrong is named."""

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest

from dropanchor_tag_client.recording import Recording, RecordingError, read_recording

SECONDS = 60
IMU_HZ, RANGE_HZ = 50, 10
Clock = Callable[[float], object]


def same(t: float) -> float:
    return t


def recording(folder: Path, imu: Clock = same, ranges: Clock = same, time: str = "t_s") -> Recording:
    """Return a recording of a tag at rest whose clocks show `imu` and `ranges` of the true time in s."""
    (folder / "anchors.csv").write_text("id,x,y,z\n1,0,0,0\n")
    rows = [f"{ranges(i / RANGE_HZ)},1,5.0" for i in range(SECONDS * RANGE_HZ)]
    (folder / "range.csv").write_text("\n".join([f"{time},anchor_id,range_m", *rows]) + "\n")
    rows = [f"{imu(i / IMU_HZ)},0,0,9.8,0,0,0" for i in range(SECONDS * IMU_HZ)]
    (folder / "imu.csv").write_text("\n".join([f"{time},ax,ay,az,gx,gy,gz", *rows]) + "\n")
    return read_recording(folder)


def assert_runs_for_a_minute(read: Recording, start_s: float = 0.0) -> None:
    for t, hz in ((read.imu["t_s"], IMU_HZ), (read.ranges["t_s"], RANGE_HZ)):
        assert t[0] == pytest.approx(start_s, abs=1e-6)
        assert [b - a for a, b in itertools.pairwise(t)] == pytest.approx([1 / hz] * (len(t) - 1), abs=1e-3)


@pytest.mark.parametrize("start_s", [0.0, -1000.0, 1_700_000_000.0])
@pytest.mark.parametrize(
    ("per_second", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1_000_000_000, "nanoseconds")]
)
def test_a_column_of_seconds_that_holds_another_unit_is_read_in_it_and_that_is_said(
    tmp_path: Path, start_s: float, per_second: float, unit: str
) -> None:
    def clock(t: float) -> str:
        return f"{(start_s + t) * per_second:.0f}"

    read = recording(tmp_path, clock, clock)
    assert_runs_for_a_minute(read, start_s)
    assert [note for note in read.notes if f"t_s holds {unit}" in note and "range.csv, imu.csv" in note] == [
        *read.notes
    ]
    assert len(read.notes) == 1


@pytest.mark.parametrize(("time", "per_second"), [("t_s", 1), ("t_ms", 1e3), ("t_us", 1e6), ("t_ns", 1e9)])
def test_a_column_may_be_named_after_its_unit_and_then_nothing_is_said(
    tmp_path: Path, time: str, per_second: float
) -> None:
    def clock(t: float) -> float:
        return (1_700_000_000 + t) * per_second

    read = recording(tmp_path, clock, clock, time)
    assert_runs_for_a_minute(read, 1_700_000_000)
    assert read.notes == ()


def test_files_may_be_in_different_units(tmp_path: Path) -> None:
    read = recording(tmp_path, ranges=lambda t: t * 1000)
    assert_runs_for_a_minute(read)
    assert "range.csv: t_s holds milliseconds" in read.notes[0]


def test_ten_imu_samples_in_a_thousand_seconds_are_milliseconds(tmp_path: Path) -> None:
    recording(tmp_path)
    rows = [f"{i * 100},0,0,9.8,0,0,0" for i in range(10)]
    (tmp_path / "imu.csv").write_text("\n".join(["t_s,ax,ay,az,gx,gy,gz", *rows]) + "\n")
    assert read_recording(tmp_path).imu["t_s"][-1] == pytest.approx(0.9)


def test_times_that_are_plausible_in_no_unit_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"too short between .*, whether the times are seconds, milliseconds"):
        recording(tmp_path, lambda t: t / 86_400, lambda t: t / 86_400)


@pytest.mark.parametrize(
    ("period", "per_second", "counter"),
    [
        (2**32, 1e6, "2^32 microseconds"),
        (2**32, 1e3, "2^32 milliseconds"),
        (2**16, 1e3, "2^16 milliseconds"),
        (2**40, 128 * 499.2e6, "2^40 ticks of the DW1000"),
    ],
)
def test_a_counter_that_wraps_is_continued_and_that_is_said(
    tmp_path: Path, period: int, per_second: float, counter: str
) -> None:
    start = period - 30 * per_second if period > 30 * per_second else 0.0

    def clock(t: float) -> str:
        return f"{(start + t * per_second) % period:.0f}"

    read = recording(tmp_path, clock if "DW" not in counter else same, clock)
    assert_runs_for_a_minute(read, start / per_second)
    assert any(
        f"range.csv line {'175' if 'DW' in counter else '302'}" in note and counter in note for note in read.notes
    )


@pytest.mark.parametrize("back_s", [1.5, 5.0, 3600.0])
def test_a_clock_that_is_set_back_is_an_error_that_names_the_line(tmp_path: Path, back_s: float) -> None:
    def clock(t: float) -> float:
        return t - back_s if t > 30 else t

    with pytest.raises(RecordingError, match=rf"imu.csv line 1503: the time goes back by {back_s:.1f} s"):
        recording(tmp_path, imu=clock)


def test_ranges_that_stand_one_anchor_after_the_other_are_in_order(tmp_path: Path) -> None:
    recording(tmp_path)
    (tmp_path / "anchors.csv").write_text("id,x,y,z\n1,0,0,0\n2,5,0,0\n")
    rows = [f"{i / 10},{anchor},5.0" for anchor in (1, 2) for i in range(100)]
    (tmp_path / "range.csv").write_text("\n".join(["t_s,anchor_id,range_m", *rows]) + "\n")
    read = read_recording(tmp_path)
    assert list(read.ranges["t_s"][:4]) == [0.0, 0.0, 0.1, 0.1]
    assert read.notes == ()
    assert read.place("range", 1) == "range.csv line 102"


def test_small_disorder_is_sorted_and_a_single_wrong_time_is_left_out(tmp_path: Path) -> None:
    def clock(t: float) -> float:
        return {20.0: 500.0, 40.0: 0.0}.get(t, t - 0.05 * (t == 10.0))

    read = recording(tmp_path, imu=clock)
    assert len(read.imu["t_s"]) == SECONDS * IMU_HZ - 2
    assert sorted(read.imu["t_s"]) == list(read.imu["t_s"])
    assert read.notes == (
        "imu.csv line 1002: a time far from those around it: left out, and 1 more like it",
        "imu.csv: rows were up to 0.03 s out of order: sorted by time",
    )


def test_many_samples_with_one_time_are_counted(tmp_path: Path) -> None:
    read = recording(tmp_path, imu=int)
    assert read.notes == (
        "imu.csv: several samples have the same time: 3,000 of 3,000 IMU samples share their time with another; the "
        "times need fractions of a second",
    )


def test_files_on_clocks_that_have_nothing_in_common_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"imu.csv holds 1700000000 to .* no time in common. Use one clock"):
        recording(tmp_path, imu=lambda t: 1_700_000_000 + t)
