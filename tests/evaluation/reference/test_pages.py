"""The generated reference: current, complete, and right in samples."""

import pytest

from dropanchor_evaluation.ablation.rules import RULES
from dropanchor_evaluation.reference import export, numbers_page, settings_page
from dropanchor_schemas.pose import StateReason, TrackingState
from dropanchor_schemas.rejections import REASONS_EXPLAINED
from dropanchor_schemas.wire import Reason


def test_the_pages_are_current() -> None:
    assert export.main(["--check"]) == 0


def test_an_edited_page_is_noticed(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    monkeypatch.setattr(export, "FOLDER", tmp_path)
    monkeypatch.setattr(export, "QUOTING", ())
    assert export.main([]) == 0
    assert export.main(["--check"]) == 0
    (export.FOLDER / "reference" / "settings.md").write_text("edited")
    assert export.main(["--check"]) == 1


def test_settings_have_type_unit_default_and_meaning() -> None:
    lines = settings_page.page().splitlines()
    assert "| `port` | integer, ≥ 0, ≤ 65535 |  | `8080` | Port to listen on; 0 takes any free one. |" in lines
    (reorder,) = [line for line in lines if line.startswith("| `reorder_ms`")]
    assert "| number, ≥ 0, ≤ 10000 | ms | `250.0` |" in reorder
    assert "## `[tags.<id>]`" in lines
    assert "## `[tags.<id>.start]`" in lines


def test_every_reason_and_state_is_explained() -> None:
    assert set(REASONS_EXPLAINED) == set(Reason)
    states = export.pages()["reference/pose-states.md"]
    assert all(f"`{name}`" in states for name in [*TrackingState, *StateReason])


def test_every_number_of_the_engine_has_a_reason_and_every_rule_its_numbers() -> None:
    found = list(numbers_page.numbers())
    assert len(found) > 100
    assert [(one.file, one.name) for one in found if not one.reason] == []
    assert {number for rule in RULES for number in rule.numbers} <= {one.name for one in found}
    assert "| `nlos_log_prior` | -2.5 |" in numbers_page.page()
