"""The Plaza sets, from a file of the same form that the test writes."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from dropanchor_evaluation.recordings import compared
from dropanchor_service.offline.plaza import MISSING, read_plaza
from dropanchor_tag_client.recording import RecordingError, read_recording
from support.recordings import recording_or_skip


def write_plaza2(folder: Path) -> None:
    """10 s eastwards at 2 m/s from (3, 4) with a heading that points backwards, two radios, ranges out of order."""
    t = 100.0 + 0.1 * np.arange(101)
    truth = np.column_stack([t, 3.0 + 2.0 * (t - 100.0), np.full(101, 4.0), np.full(101, -math.pi)])
    reckoning = np.column_stack([t[1:], np.full(100, 0.2), np.full(100, 0.001)])
    times = 100.05 + 0.5 * np.arange(20)
    near = np.hypot(3.0 + 2.0 * (times - 100.0), 4.0)
    ranges = np.column_stack([times, np.full(20, 2.0), np.where(np.arange(20) % 2, 7.0, 1.0), 1.069 * near])
    tables = {"GT": truth, "DR": reckoning, "TD": ranges[::-1], "TL": [[7.0, 0.0, 0.0], [1.0, 0.0, 0.0]]}
    savemat(folder / "Plaza2_.mat", tables)


def test_times_begin_at_zero_and_the_heading_is_turned_into_the_direction_of_travel(tmp_path: Path) -> None:
    write_plaza2(tmp_path)
    recording = read_plaza("plaza2", tmp_path)
    assert [anchor.id for anchor in recording.anchors] == ["1", "7"]
    assert recording.truth["t_s"][0] == 0.0
    assert recording.truth["yaw_rad"][0] == pytest.approx(0.0)
    assert list(recording.ranges["t_s"]) == sorted(recording.ranges["t_s"])
    assert recording.ranges["t_s"][0] == pytest.approx(0.05)
    assert recording.ranges["range_m"][0] == pytest.approx(1.069 * math.hypot(3.1, 4.0))
    assert recording.range_anchors[:3] == ("1", "7", "1")


def test_the_heading_is_the_first_true_one_and_the_turns_that_were_measured(tmp_path: Path) -> None:
    write_plaza2(tmp_path)
    headings = read_plaza("plaza2", tmp_path).headings
    assert len(headings["t_s"]) == 101
    assert headings["yaw_rad"][0] == pytest.approx(0.0, abs=1e-9)
    assert headings["yaw_rad"][-1] == pytest.approx(0.1)


def test_it_is_a_recording_like_any_other(tmp_path: Path) -> None:
    write_plaza2(tmp_path)
    found = compared(read_plaza("plaza2", tmp_path))
    assert set(found) == {"1", "7"}
    assert found["1"]["vanilla EKF, tuned"].rmse < 2.0


def test_a_missing_or_invalid_file_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="plaza1, plaza2"):
        read_plaza("plaza3", tmp_path)
    with pytest.raises(RecordingError, match=r"Plaza2_\.mat cannot be read"):
        read_plaza("plaza2", tmp_path)
    savemat(tmp_path / "Plaza2_.mat", {"GT": np.zeros((2, 4))})
    with pytest.raises(RecordingError, match="TD"):
        read_plaza("plaza2", tmp_path)


@pytest.mark.skipif(importlib.util.find_spec("gtsam") is not None, reason="gtsam is installed")
def test_without_gtsam_the_message_says_what_to_install() -> None:
    with pytest.raises(RecordingError) as error:
        read_plaza("plaza2")
    assert str(error.value) == MISSING
    assert MISSING.endswith(f"{sys.executable} -m pip install gtsam")


@pytest.mark.recordings
@pytest.mark.skipif(importlib.util.find_spec("gtsam") is None, reason="gtsam is not installed")
def test_the_set_in_gtsam_is_the_recording_that_others_made_of_it() -> None:
    ours, theirs = read_plaza("plaza2"), read_recording(recording_or_skip("plaza2"))
    for name in ("t_s", "range_m"):
        np.testing.assert_allclose(ours.ranges[name], theirs.ranges[name], atol=1e-3)
    for name in ("t_s", "x", "y", "yaw_rad"):
        np.testing.assert_allclose(ours.truth[name], theirs.truth[name], atol=1e-3)
    np.testing.assert_allclose(ours.headings["yaw_rad"], theirs.headings["yaw_rad"], atol=1e-3)
