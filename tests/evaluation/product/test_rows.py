"""Which rows and which seeds there are."""

import re
from pathlib import Path

import pytest

from dropanchor_evaluation.product.rows import (
    FIRST_REPORTED_SEED,
    NoRowError,
    purpose,
    recorded_rows,
    selected,
    simulated_rows,
)
from dropanchor_evaluation.product.work import tasks
from dropanchor_evaluation.results import PAGES
from support.recordings import write_square


def test_every_row_has_a_name_of_its_own() -> None:
    names = [row.name for row in simulated_rows()]
    assert len(names) == len(set(names))
    for wanted in ("S5/scalar/everything/known", "forklift/6-axis/mount/unknown", "walk-turned/9-axis/nothing/known"):
        assert wanted in names


def test_patterns_select_rows_in_their_order_and_nothing_else() -> None:
    rows = simulated_rows()
    found = selected(rows, ["walk-*/6-axis/*", "S5/scalar/*/known"])
    assert [row.name for row in found[:3]] == [
        f"S5/scalar/{configured}/known" for configured in ("everything", "mount", "nothing")
    ]
    assert all(row.sensors == "6-axis" and row.motion.startswith("walk-") for row in found[3:])
    assert selected(rows, []) == rows


def test_a_pattern_that_matches_no_row_is_named() -> None:
    with pytest.raises(NoRowError, match="helicopter"):
        selected(simulated_rows(), ["S5/*", "helicopter/*"])


def test_rows_of_one_task_share_their_runs() -> None:
    rows = simulated_rows()
    found = tasks(rows, range(5000, 5002))
    assert [row for task in found for row in task.rows] == rows
    assert all(row.runs_of == task.rows[0].runs_of for task in found for row in task.rows)
    assert len(found) < len(rows) / 3


def test_recordings_and_walks_become_rows_where_they_are(tmp_path: Path) -> None:
    for name in ("square", "phones/a_front", "phones/b_front", "phones/a_turn"):
        (tmp_path / name).mkdir(parents=True)
        write_square(tmp_path / name)
    rows = recorded_rows(tmp_path)
    assert [row.name for row in rows] == [
        "square/recorded/operator/known",
        "square/recorded/nothing/known",
        "square/recorded/nothing/unknown",
        *(f"phones-{kind}/recorded/nothing/{start}" for kind in ("front", "turn") for start in ("known", "unknown")),
    ]
    assert [len(row.folders) for row in rows] == [1, 1, 1, 2, 2, 1, 1]
    assert recorded_rows(tmp_path / "none") == []


def test_seeds_are_for_development_or_for_reports_and_never_for_both() -> None:
    assert purpose(range(5000, 6000)) == "development"
    assert purpose(range(20_000, 20_100)) == "development"  # a report has used them
    assert purpose(range(FIRST_REPORTED_SEED, FIRST_REPORTED_SEED + 100)) == "reported"
    for wrong in (range(10), range(5990, 6010), range(19_990, 20_010), range(0)):
        with pytest.raises(ValueError, match="seeds"):
            purpose(wrong)


def test_seeds_of_a_report_are_not_reported_again() -> None:
    for page in PAGES.glob("*.md"):
        for first, last in re.findall(r'<!-- results \w+ seeds="(\d+)-(\d+)"', page.read_text(encoding="utf-8")):
            assert int(last) < FIRST_REPORTED_SEED, f"{page.name} has used {first} to {last}: raise FIRST_REPORTED_SEED"
