"""Tables are read however they are written, and what is decided, converted and left out is said."""

import json
from codecs import BOM_UTF8, BOM_UTF16_LE

import pytest

from service.importing.command import Import

PLAIN = "t,anchor,range\n0.0,A,5.5\n0.1,A,5.25\n0.2,A,5\n"
IMU = "t,ax,ay,az,gx,gy,gz\n"


def imu_rows(count: int = 40, az: float = 9.81, separator: str = ",") -> str:
    return "".join(separator.join(map(str, (i / 100, 0, 0, az, 0, 0, 0.5))) + "\n" for i in range(count))


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", " | "),
        PLAIN.replace(",", "   "),
        PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", "\t").replace(".", ","),
        't,anchor,range\n"0,0",A,"5,5"\n"0,1","A","5,25"\n"0,2",A,5\n',
        "# made by hand\n\n" + PLAIN.replace("\n", "\n\n") + "# end\n",
        "# t anchor range\n" + PLAIN.partition("\n")[2].replace(",", " "),
        "%time,anchor,range\n" + PLAIN.partition("\n")[2],
        "Device: X1\nRate 10 Hz\n" + PLAIN,
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", ",\n"),
        BOM_UTF8 + PLAIN.encode(),
        BOM_UTF16_LE + PLAIN.encode("utf-16-le"),
        PLAIN.encode("utf-16-le"),
        PLAIN.replace("anchor", "beacon").replace("range", "distance (m)").encode() + "# \xe4".encode("latin-1"),
    ],
)
def test_any_way_to_write_a_table_gives_the_same_ranges(run: Import, content: str | bytes) -> None:
    ended = run(run.file("uwb.csv", content))
    assert ended.status == 0, ended.error
    assert ended.column("range", "range_m") == [5.5, 5.25, 5]
    assert ended.column("range", "t_s") == [0.0, 0.1, 0.2]
    assert {row["anchor_id"] for row in ended.rows("range")} == {"A"}


@pytest.mark.parametrize(
    "content",
    [
        '{"t": 0.0, "uwb": {"anchor": "A", "range": "5.5"}}\n\n{"t": 0.1, "uwb": {"anchor": "A", "range": 5.25}}\n',
        '[{"t": 0.0, "uwb": {"anchor": "A", "range": 5.5}}, {"t": 0.1, "uwb": {"anchor": "A", "range": 5.25}}]',
        '{"data": [{"t": 0.0, "anchor": "A", "range": 5.5}, {"t": 0.1, "anchor": "A", "range": 5.25}]}',
        '{"t": 0, "ranges": [{"anchor": "A", "range": 5.5}]}\n{"t": 0.1, "ranges": [{"anchor": "A", "range": 5.25}]}\n',
    ],
)
def test_json_is_read_with_its_nested_fields(run: Import, content: str) -> None:
    ended = run(run.file("uwb.jsonl", content))
    assert ended.status == 0, ended.error
    assert ended.column("range", "range_m") == [5.5, 5.25]


def test_arrays_of_json_are_the_axes(run: Import) -> None:
    lines = [{"t": i / 100, "acc": [1, 2, 9.81], "gyro": [0, 0, 0.5], "range": 5, "anchor": 7} for i in range(3)]
    ended = run(run.file("log.jsonl", "\n".join(map(json.dumps, lines))))
    assert ended.column("imu", "ay") == [2, 2, 2]
    assert ended.rows("range")[0]["anchor_id"] == "7"


def test_each_conversion_is_a_line_and_the_mapping_can_be_pasted(run: Import) -> None:
    header = "time_ms;acc_x [g];acc_y [g];acc_z [g];gyro_x_dps;gyro_y_dps;gyro_z_dps;dist_cm;id_of_anchor\n"
    table = run.file("log.csv", header + "".join(f"{10 * i};0;0;1;0;0;90;{500 + i};A\n" for i in range(30)))
    ended = run(table)
    assert "acc_x [g], acc_y [g], acc_z [g]: converted from g to m/s2 (times 9.80665)" in ended.printed
    assert "converted from deg/s to rad/s (times 0.01745329252)" in ended.printed
    assert "dist_cm: converted from cm to m (times 0.01)" in ended.printed
    assert ended.column("imu", "az") == pytest.approx([9.80665] * 30)
    assert ended.column("imu", "gz") == pytest.approx([1.570796327] * 30)
    pasted = next(line for line in ended.printed.splitlines() if line.startswith("  --map"))
    assert pasted.endswith("range=dist_cm:cm")
    assert "'ax=acc_x [g]:g'" in pasted
    saved = run.folder / "map.toml"
    assert run(table, "--save-map", saved, out="a").status == 0
    again = run(table, "--map-file", saved, out="b")
    assert again.status == 0
    assert "guessed" not in again.printed
    assert again.rows("imu") == ended.rows("imu")


def test_a_mapping_says_columns_units_signs_and_scales(run: Import) -> None:
    table = run.file("raw.txt", "".join(f"{i},{16384},0,0,0,0,0,{i}\n" for i in range(5)))
    words = ["t=1:ms", "az=-2:g/16384", "ax=3", "ay=4", "gx=5:deg/s", "gy=6", "gz=7", "range.B=8:in"]
    ended = run(table, "--map", *words)
    assert ended.status == 0, ended.error
    assert "there is no header: the columns are numbered 1 to 8" in ended.printed
    assert ended.column("imu", "az") == pytest.approx([-9.80665] * 5)
    assert ended.column("range", "range_m") == pytest.approx([0.0254 * i for i in range(5)])
    assert {row["anchor_id"] for row in ended.rows("range")} == {"B"}


def test_imu_and_ranges_may_be_in_several_files_with_other_columns(run: Import) -> None:
    imu = run.file("imu.csv", "stamp" + IMU[1:] + imu_rows())
    uwb = run.file("uwb.csv", "clock,r\n" + "".join(f"{100 * i},{i}\n" for i in range(4)))
    ended = run(
        imu,
        uwb,
        "--map",
        "uwb.csv/t=clock:ms",
        "range=r",
        "imu.csv/t=stamp:s",
        *(f"{a}={a}" for a in IMU.strip().split(",")[1:]),
    )
    assert ended.status == 0, ended.error
    assert ended.column("range", "t_s") == [0, 0.1, 0.2, 0.3]
    assert len(ended.rows("imu")) == 40
    assert "clocks: the IMU and the ranges overlap for 0.3 s" in ended.printed


def test_accelerometer_and_gyroscope_may_have_times_of_their_own(run: Import) -> None:
    run.file("s/acc.csv", "t,x,y,z\n" + "".join(f"{i / 50},{i},0,9.81\n" for i in range(20)))
    run.file("s/gyro.csv", "t,x,y,z\n" + "".join(f"{i / 100},0,0,1\n" for i in range(20)))
    run.file("s/uwb.csv", PLAIN)
    ended = run(run.folder / "s")
    assert ended.status == 0, ended.error
    assert ended.column("imu", "ax") == pytest.approx([i / 2 for i in range(20)])


def test_a_range_that_is_repeated_beside_an_imu_is_one_range(run: Import) -> None:
    rows = [f"{i / 100},0,0,9.81,0,0,0,{5 + i // 10}" for i in range(40)]
    ended = run(run.file("log.csv", IMU.strip() + ",range\n" + "\n".join(rows)))
    assert ended.column("range", "range_m") == [5, 6, 7, 8]
    assert "36 rows repeat the range before" in ended.printed


def test_utc_is_counted_from_a_full_second_that_is_named(run: Import) -> None:
    table = "time,range\n" + "".join(f"2025-10-09T08:53:20.{i}50Z,5\n" for i in range(5))
    ended = run(run.file("uwb.csv", table))
    assert ended.column("range", "t_s") == pytest.approx([0.05, 0.15, 0.25, 0.35, 0.45])
    assert "t_s = 0 is 2025-10-09 08:53:20 UTC" in ended.printed


def test_rows_that_make_no_sense_are_left_out_with_their_lines(run: Import) -> None:
    bad = "0.3,A,far\n,A,1\nsoon,A,1\n0.4,A\n0.5,,2\n0.6,A,\n0.7,A,nan\n"
    ended = run(run.file("uwb.csv", PLAIN + bad))
    assert ended.column("range", "range_m") == [5.5, 5.25, 5]
    for sentence in (
        "uwb.csv: 1 left out: range is not a number (line 5)",
        "uwb.csv: 1 left out: there is no time (line 6)",
        "uwb.csv: 1 left out: the time is not a number (line 7)",
        "uwb.csv: 1 left out: the number of values is not 3 (line 8)",
        "uwb.csv: 1 left out: the range has no anchor (line 9)",
    ):
        assert sentence in ended.printed


def test_positions_of_anchors_come_from_a_table_or_the_option(run: Import) -> None:
    run.file("s/anchors.csv", "id;x;y;z\nA;1,5;2;3\n")
    run.file("s/uwb.csv", PLAIN)
    assert run(run.folder / "s").rows("anchors") == [{"id": "A", "x": "1.5", "y": "2.0", "z": "3.0"}]
    told = run(run.folder / "s", "--anchor", "A=-4,5,6", out="told")
    assert told.rows("anchors") == [{"id": "A", "x": "-4.0", "y": "5.0", "z": "6.0"}]


def test_the_only_anchor_is_at_the_origin_and_that_is_said(run: Import) -> None:
    ended = run(run.file("uwb.csv", PLAIN))
    assert ended.rows("anchors") == [{"id": "A", "x": "0.0", "y": "0.0", "z": "0.0"}]
    assert "anchor A is taken to be at 0,0,0 (--anchor A=X,Y,Z)" in ended.printed


@pytest.mark.parametrize(
    ("az", "sentence"),
    [
        (1.0, "The accelerations look like g, not m/s²"),
        (1.0, "Here: --map ax=ax:g ay=ay:g az=az:g"),
        (1001.0, "The accelerations look like thousandths of g"),
        (0.2, "Gravity is missing from the accelerations"),
        (50.0, "The accelerations are 50.0 m/s² on average"),
    ],
)
def test_accelerations_that_cannot_be_right_are_named(run: Import, az: float, sentence: str) -> None:
    run.file("s/imu.csv", IMU + imu_rows(400, az=az))
    run.file("s/uwb.csv", PLAIN)
    assert sentence in run(run.folder / "s").printed


def test_accelerations_that_may_be_right_are_not_mentioned(run: Import) -> None:
    run.file("s/imu.csv", IMU + imu_rows(400))
    run.file("s/uwb.csv", PLAIN)
    printed = run(run.folder / "s").printed
    assert "he accelerations" not in printed
    assert "ravity" not in printed


def test_clocks_that_do_not_overlap_are_named(run: Import) -> None:
    run.file("s/imu.csv", IMU + imu_rows())
    run.file("s/uwb.csv", "t,range\n500,5\n500.1,5\n")
    assert "the IMU and the ranges do not overlap: they are 499.6 s apart" in run(run.folder / "s").printed


def test_clocks_that_are_days_apart_are_refused(run: Import) -> None:
    run.file("s/imu.csv", IMU + imu_rows())
    run.file("s/uwb.csv", "time_ms,range\n1760000000000,5\n1760000000100,5\n")
    ended = run(run.folder / "s")
    assert ended.status == 2
    assert (
        "the times of the IMU end 20370 days before those of the ranges begin: they are not of one clock" in ended.error
    )


def test_rows_from_before_the_clock_was_set_are_left_out(run: Import) -> None:
    rows = "".join(f"{t},A,5\n" for t in (0, 100, *range(1760000000000, 1760000001000, 100)))
    ended = run(run.file("uwb.csv", "time_ms,anchor,range\n" + rows))
    assert len(ended.rows("range")) == 10
    assert "uwb.csv line 2: a time more than 30 days from most others: left out, and 1 more like it" in ended.printed


def test_the_axes_of_the_imu_can_be_turned(run: Import) -> None:
    run.file("s/imu.csv", IMU + "".join(f"{i / 100},1,2,9.81,0,0,0\n" for i in range(5)))
    run.file("s/uwb.csv", PLAIN)
    ended = run(run.folder / "s", "--forward=-y", "--up", "z")
    assert [ended.column("imu", axis)[0] for axis in ("ax", "ay", "az")] == [-2, 1, 9.81]


@pytest.mark.parametrize("column", ["time", "time_of_day"])
def test_times_of_day_go_on_behind_midnight(run: Import, column: str) -> None:
    ended = run(run.file("uwb.csv", f"{column},anchor,range\n23:59:59.5,A,5\n23:59:59.9,A,6\n0:00:00.3,A,7\n"))
    assert ended.status == 0, ended.error
    assert ended.column("range", "t_s") == pytest.approx([0.5, 0.9, 1.3])
    assert f"{column} is a time of day, 1 times past midnight" in ended.printed
