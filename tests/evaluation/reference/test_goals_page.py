"""The goals of the engine beside the tables of results."""

import re
from pathlib import Path

import pytest

from dropanchor_evaluation.product.rows import simulated_rows
from dropanchor_evaluation.reference import goals_page
from dropanchor_evaluation.reference.goals_page import GOALS, HONEST, Goal, Honesty, rows_of
from dropanchor_evaluation.results import PAGES

TABLE = """\
<!-- results product seeds="1-2" measures="x" sources="0" table="0" -->

| motion / sensors / configured / start | RMSE | 2nd half | worst | 95 % ellipse holds |
|---|---|---|---|---|
| S5/scalar/everything/known | 0.18 / 0.33 | 0.1 / 0.2 | 4.0 σ | 0.940 |
| S5/scalar/nothing/known | 0.90 / 1.20 | 0.8 / 1.0 | 6.5 σ | 0.910 |

<!-- end product -->
<!-- results bounds seeds="1-2" measures="x" sources="0" table="0" -->
| motion / sensors / configured / start | bound | efficient: RMSE | 2nd half |
|---|---|---|---|
| S5/scalar/everything/known | 0.1 | 0.11 / 0.19 | 0.12 / 0.20 |
<!-- end bounds -->
"""


def test_goals_name_rows_that_are_measured() -> None:
    measured = {row.name for row in simulated_rows()}
    assert {goal.row for goal in GOALS} <= measured
    assert all(goal.row in rows_of((PAGES / "scenarios.md").read_text(), "product") for goal in GOALS)


def test_a_table_of_results_is_read_by_row_and_column() -> None:
    assert rows_of(TABLE, "product")["S5/scalar/everything/known"]["RMSE"] == "0.18 / 0.33"
    assert rows_of(TABLE, "bounds")["S5/scalar/everything/known"]["efficient: 2nd half"] == "0.12 / 0.20"
    assert rows_of(TABLE, "no such table") == {}


def test_a_goal_is_reached_by_median_and_quantile_or_says_why_not(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "scenarios.md").write_text(TABLE)
    monkeypatch.setattr(goals_page, "PAGES", tmp_path)
    monkeypatch.setattr(
        goals_page,
        "GOALS",
        (
            Goal("S5/scalar/everything/known", "RMSE", 0.18, 0.33, "never said"),
            Goal("S5/scalar/everything/known", "2nd half", 0.1, 0.19, "the tail"),
        ),
    )
    monkeypatch.setattr(goals_page, "HONEST", (Honesty("all", ("S5/*",), "because"), Honesty("none", ("P/*",), "")))
    text = goals_page.page()
    assert "| S5/scalar/everything/known | whole run | 0.18 / 0.33 | 0.11 / 0.19 | 0.18 / 0.33 | reached |" in text
    assert "| S5/scalar/everything/known | second half | 0.10 / 0.19 | 0.12 / 0.20 | 0.1 / 0.2 | the tail |" in text
    assert re.search(r"\| all \| 0.910 \(S5/scalar/nothing/known\) \| 1 of 2 \| 6.5 σ .* \| because \|", text)
    assert "none" not in text.partition("## Honesty")[2]


def test_every_row_of_the_table_belongs_to_one_group_of_honesty() -> None:
    for name in rows_of((PAGES / "scenarios.md").read_text(), "product"):
        assert sum(goals_page.belongs_to(name, one) for one in HONEST) == 1, name
