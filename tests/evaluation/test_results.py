"""Tables in the documentation are written between markers and checked for age and manual edits."""

from pathlib import Path

import pytest

from benchmarks.report import SOURCES, page_of
from dropanchor_evaluation import results
from dropanchor_evaluation.results import Measured, NoPlaceError, main, older, problems, require_place, write

PAGE = "# Results\n\n<!-- results speed -->\n<!-- end speed -->\n\nWhat it means.\n"
CODE = '"""Doc."""\n\n\ndef twice(x):\n    """Double."""\n    return 2 * x  # why\n'


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "page.md").write_text(PAGE)
    (tmp_path / "code.py").write_text(CODE)
    return tmp_path


def found(root: Path) -> list[str]:
    return list(problems(root, [root / "page.md"]))


def measure(root: Path, text: str = "| a |\n|---|\n| 1 |") -> None:
    write(root, root / "page.md", "speed", text, Measured(["code.py"], seeds="0-9"))


def test_a_place_without_figures_is_a_problem(root: Path) -> None:
    assert found(root) == ["page.md, speed: nothing has been measured yet"]


def test_a_written_table_is_current_and_says_where_it_comes_from(root: Path) -> None:
    measure(root)
    assert found(root) == []
    text = (root / "page.md").read_text()
    assert "| 1 |" in text
    assert "seeds 0-9" in text
    assert text.endswith("What it means.\n")


def test_writing_again_replaces_the_table(root: Path) -> None:
    measure(root)
    measure(root, "| b |")
    text = (root / "page.md").read_text()
    assert "| b |" in text
    assert "| 1 |" not in text
    assert found(root) == []


def test_a_place_becomes_a_table_and_is_no_problem_before(root: Path) -> None:
    (root / "page.md").write_text("Before.\n\n<!-- place for speed -->\n\nAfter.\n")
    assert found(root) == []
    measure(root)
    text = (root / "page.md").read_text()
    assert text.startswith("Before.\n\n<!-- results speed ")
    assert text.endswith("<!-- end speed -->\n\nAfter.\n")
    assert "place for" not in text


def test_a_manual_edit_is_detected(root: Path) -> None:
    measure(root)
    page = root / "page.md"
    page.write_text(page.read_text().replace("| 1 |", "| 0 |"))
    assert found(root) == ["page.md, speed: the table was edited by hand; measure it again"]


def test_a_code_change_makes_a_table_outdated_and_a_comment_change_does_not(root: Path) -> None:
    measure(root)
    (root / "code.py").write_text(CODE.replace("Double.", "Return the double.").replace("# why", "# because"))
    assert older(root, root / "page.md") == []
    (root / "code.py").write_text(CODE.replace("2 * x", "3 * x"))
    assert older(root, root / "page.md") == ["speed"]
    assert found(root) == []


def test_the_code_of_the_page_counts_and_so_does_its_removal(root: Path) -> None:
    (root / "map").mkdir()
    script = root / "map" / "draw.js"
    script.write_text("draw();\n")
    write(root, root / "page.md", "speed", "| 1 |", Measured(["map"]))
    assert older(root, root / "page.md") == []
    script.write_text("drawTwice();\n")
    assert older(root, root / "page.md") == ["speed"]
    script.unlink()
    assert older(root, root / "page.md") == ["speed"]


def test_the_command_checks_and_does_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert "--check" in capsys.readouterr().err


def test_the_command_says_where_to_find_how_to_measure_an_edited_table(
    root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(results, "ROOT", root)
    monkeypatch.setattr(results, "PAGES", root)
    measure(root)
    assert main(["--check"]) == 0
    page = root / "page.md"
    page.write_text(page.read_text().replace("| 1 |", "| 0 |"))
    assert main(["--check"]) == 1
    assert "results/README.md names the command" in capsys.readouterr().err


def test_a_page_without_a_place_is_an_error(root: Path) -> None:
    with pytest.raises(NoPlaceError, match=r"page\.md has no place for height"):
        write(root, root / "page.md", "height", "", Measured(["code.py"]))


@pytest.mark.parametrize("table", SOURCES)
def test_every_table_of_the_benchmarks_has_a_place(table: str) -> None:
    assert require_place(page_of(table), table)
