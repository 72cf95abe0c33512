"""Samples of what people have, which lie in a folder beside the checkout."""

import os
from pathlib import Path

import pytest

from service.importing.command import Import

ROOT = Path(__file__).resolve().parents[3]


def sample_or_skip(name: str) -> Path:
    """Return a sample. Skip the test where it is missing.

    The samples lie in the folder DROPANCHOR_SHARED, or in `../shared` beside the checkout.
    """
    shared = Path(os.environ.get("DROPANCHOR_SHARED", ROOT / ".." / "shared"))
    path = shared / "field" / "devices" / "csv" / name
    if not path.exists():
        pytest.skip(
            f"{path} does not exist: put the samples there, or set DROPANCHOR_SHARED to the folder that has them"
        )
    return path


@pytest.mark.parametrize(
    ("name", "imu", "ranges"),
    [
        ("semicolon_comma_decimal", 1000, 200),
        ("comma_decimal_quoted", 1000, 200),
        ("blank_lines_comment", 1000, 200),
        ("unix_s", 1000, 200),
        ("rosbag.mcap", 2000, 200),
        ("data.csv", 0, 1),
    ],
)
def test_a_sample_is_imported(run: Import, name: str, imu: int, ranges: int) -> None:
    ended = run(sample_or_skip(name))
    assert ended.status == 0, ended.error
    assert len(ended.rows("range")) == ranges
    assert (len(ended.rows("imu")) if imu else 0) == imu
    assert float(ended.rows("range")[0]["t_s"]) == 0.0


def test_an_export_whose_gyroscope_holds_accelerations_is_refused(run: Import) -> None:
    ended = run(sample_or_skip("phyphox_export_folder"))
    assert ended.status == 2
    assert "the columns of Gyroscope.csv are Time (s), Acceleration x (m/s^2)" in ended.error
