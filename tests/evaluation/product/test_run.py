"""Rows from simulation to table, with two seeds."""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dropanchor_evaluation.commands.product import seed_range
from dropanchor_evaluation.product.rows import FIRST_REPORTED_SEED, Row, recorded_rows
from dropanchor_evaluation.product.runs import sources, tag_run
from dropanchor_evaluation.product.work import Task, run_tags, work
from dropanchor_service.cli import main
from dropanchor_service.estimation.fleet.engine import FleetEngine
from support.recordings import write_square

SEEDS = range(5000, 5002)


def test_a_fully_configured_cart_is_tracked_and_every_tag_is_scored() -> None:
    (result,) = work(Task((Row("C5", "scalar", "everything", "known"),), SEEDS))
    assert [tag.name for tag in result.tags] == ["5000", "5001"]
    assert result.score.rmse[0] < 1.0
    assert result.score.tracking_after_s == 0.0
    assert result.score.coverage > 0.5
    assert 0.0 < result.score.us < 1e5


def test_tags_in_one_engine_do_not_affect_each_other() -> None:
    row = Row("C5", "9-axis", "nothing", "known")
    runs = [tag_run(row, one) for one in sources(row, SEEDS)]
    together, _ = run_tags(FleetEngine(), runs)
    for run, track in zip(runs, together, strict=True):
        (alone,), _ = run_tags(FleetEngine(), [run])
        np.testing.assert_array_equal(alone.poses["x"], track.poses["x"])
        assert len(track.poses) > 300


def test_rows_differ_in_their_samples_and_settings() -> None:
    row = Row("C5", "9-axis", "everything", "known")
    (source,) = sources(row, SEEDS[:1])
    configured = tag_run(row, source)
    unconfigured = tag_run(replace(row, configured="nothing", start="unknown"), source)
    assert np.isfinite(configured.settings["mount_angle"])
    assert configured.settings["start_known"]
    assert np.isnan(unconfigured.settings["mount_angle"])
    assert not unconfigured.settings["start_known"]
    assert not unconfigured.no_north
    six = tag_run(replace(row, sensors="6-axis", start="unknown"), source)
    assert np.isfinite(configured.samples.imu["mag"]).all()
    assert np.isnan(six.samples.imu["mag"]).all()
    assert six.no_north
    scalar = tag_run(replace(row, sensors="scalar"), source)
    assert len(scalar.samples.headings) > 0
    assert len(configured.samples.headings) == 0


def test_a_recording_gets_only_the_settings_of_its_row(tmp_path: Path) -> None:
    (tmp_path / "square").mkdir()
    write_square(tmp_path / "square", range_std_m=0.05)
    rows = recorded_rows(tmp_path)
    results = [result for row in rows for result in work(Task((row,), SEEDS))]
    operator, known, unknown = results
    assert [tag.name for tag in operator.tags] == ["square/A"]
    assert operator.score.rmse[0] < 2.0
    assert known.score.tags == unknown.score.tags == 1
    (source,) = sources(rows[2], SEEDS)
    assert not tag_run(rows[2], source).settings["start_known"]


def test_the_command_writes_the_table_and_every_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = tmp_path / "README.md"
    document.write_text("before\n<!-- results product -->\nof last year\n<!-- end product -->\nafter\n")
    options = ["--seeds", "5000-5001", "--jobs", "1", "--data", str(tmp_path / "none")]
    rows = ["--rows", "C5/scalar/everything/known", "rolling/6-axis/nothing/unknown"]
    assert main(["evaluate", "product", *rows, *options, "--out", str(tmp_path), "--into", str(document)]) == 0
    printed = capsys.readouterr()
    assert "| C5/scalar/everything/known |" in printed.out
    assert "seeds 5000 to 5001 (development)" in printed.out
    assert "100%" in printed.err
    found = json.loads((tmp_path / "product.json").read_text())
    assert set(found["rows"]) == set(rows[1:])
    assert len(found["rows"]["C5/scalar/everything/known"]["by_tag"]) == 2
    text = document.read_text()
    assert text.startswith("before\n<!--")
    assert text.endswith("-->\nafter\n")
    assert "| C5/scalar/everything/known |" in text
    assert "of last year" not in text
    assert "| C5/scalar/everything/known |" in (tmp_path / "product.md").read_text()


def test_the_rows_can_be_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "product", "--list", "--rows", "P/*", "--data", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "P/scalar/everything/known"


def test_the_errors_for_a_wrong_pattern_and_wrong_seeds_say_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", "product", "--rows", "none/*", "--data", str(tmp_path)]) == 2
    assert "--list prints all rows" in capsys.readouterr().err
    with pytest.raises(argparse.ArgumentTypeError, match=f"{FIRST_REPORTED_SEED} and above"):
        seed_range("0-99")
    assert seed_range("5003") == range(5003, 5004)


def test_a_page_without_markers_is_an_error_and_stays_unchanged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "other.md"
    page.write_text("text\n")
    options = ["--rows", "C5/scalar/everything/known", "--seeds", "5000", "--jobs", "1", "--data", str(tmp_path)]
    assert main(["evaluate", "product", *options, "--into", str(page)]) == 2
    assert "other.md has no place for product" in capsys.readouterr().err
    assert page.read_text() == "text\n"
