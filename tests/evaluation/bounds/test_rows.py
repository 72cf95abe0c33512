"""From the rows of the evaluation to the table of bounds, with two seeds."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dropanchor_evaluation.bounds.report import engine_cells
from dropanchor_evaluation.bounds.rows import bounded_rows, knowledge, work
from dropanchor_evaluation.product import report as product
from dropanchor_evaluation.product.rows import Row
from dropanchor_evaluation.product.work import Task
from dropanchor_service.cli import main

SEEDS = range(5000, 5002)
ROW = "S5/scalar/nothing/known"
CELLS = [ROW, "0.58 / 1.53", "0.65 / 1.87", "0.32 / 0.67", "10%", "0.0 s", "0%", "93%", "0.999", "19.6 σ", "120"]


def page(folder: Path, seeds: str) -> Path:
    path = folder / "scenarios.md"
    table = f'<!-- results product seeds="{seeds}" -->\n\n| {" | ".join(CELLS)} |\n\n<!-- end product -->\n'
    path.write_text(f"before\n{table}\n<!-- place for bounds -->\nafter\n")
    return path


def test_the_rows_are_those_of_vehicles_told_everything_or_nothing() -> None:
    rows = bounded_rows()
    assert Row("forklift", "6-axis", "nothing", "unknown") in rows
    assert not [row for row in rows if row.configured == "mount" or row.motion.startswith("walk")]
    assert len(set(rows)) == len(rows)


def test_what_a_row_does_not_tell_is_unknown() -> None:
    told = knowledge(Row("S5", "9-axis", "everything", "known"))
    nothing = knowledge(Row("S5", "6-axis", "nothing", "unknown"))
    assert (told.mount, told.bearing) == (0.0, False)
    assert told.yaw < knowledge(Row("S5", "scalar", "everything", "known")).yaw
    assert nothing.mount > 1.0
    assert nothing.start > told.start
    assert nothing.bearing


def test_the_bound_falls_with_what_is_told_and_with_better_sensors() -> None:
    rows = [Row("S5", sensors, told, "known") for sensors in ("scalar", "9-axis") for told in ("everything", "nothing")]
    scalar, scalar_untold, raw, raw_untold = (work(Task((row,), SEEDS))[0] for row in rows)
    assert scalar.never_slips[0].whole < raw.never_slips[0].whole
    for told, untold in ((scalar, scalar_untold), (raw, raw_untold)):
        cases = (told.never_slips, untold.never_slips, untold.class_rigid, untold.class_loose)
        assert all(less[0].whole < more[0].whole for less, more in pairwise(cases))
        assert not told.class_rigid
    rotated = np.concatenate([run.efficient for run in raw_untold.never_slips])
    assert (rotated[:, 2] <= rotated[:, 1]).all()


def test_the_command_writes_the_bounds_beside_the_figures_of_the_engine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = page(tmp_path, "5000-5001")
    options = ["--seeds", "5000-5001", "--processes", "1", "--into", str(path)]
    assert main(["evaluate", "bounds", "--rows", ROW, "S5/6-axis/everything/unknown", *options]) == 0
    written = path.read_text().partition("<!-- results bounds")[2]
    line, without_start = (line for line in written.splitlines() if line.startswith("| S5/"))
    assert line.endswith("| 0.58 / 1.53 | 0.65 / 1.87 | 0.32 / 0.67 |")
    cells = [cell.strip() for cell in without_start.split("|")]
    assert cells[2] == "–"  # before the start is found there is no bound
    assert 0.1 < float(cells[3]) < 1.0
    assert cells[7] == cells[8]  # judged up to a rotation anyway
    assert "seeds 5000-5001" in written
    assert f"| {ROW} | " in capsys.readouterr().out


def test_the_engines_figures_of_other_seeds_are_not_shown(tmp_path: Path) -> None:
    assert engine_cells(page(tmp_path, "20000-20099"), "5000-5001") == {}
    assert engine_cells(page(tmp_path, "5000-5001"), "5000-5001")[ROW] == CELLS[1:4]
    assert len(CELLS) == len(product.COLUMNS)


def test_a_page_without_a_place_and_a_wrong_pattern_are_errors_and_the_rows_can_be_listed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "other.md"
    path.write_text("text\n")
    assert main(["evaluate", "bounds", "--seeds", "5000", "--processes", "1", "--into", str(path)]) == 2
    assert "other.md has no place for bounds" in capsys.readouterr().err
    assert main(["evaluate", "bounds", "--rows", "walk-*"]) == 2
    assert "--list prints all rows" in capsys.readouterr().err
    assert main(["evaluate", "bounds", "--list", "--rows", "P/*"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "P/scalar/everything/known"
