"""Pages quote the tables of results as they are."""

import re
from pathlib import Path

import pytest

from dropanchor_evaluation.reference import export, quotations
from dropanchor_evaluation.results import PAGES, ROOT

ROW = "| forklift/9-axis/nothing/known |"


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with copies of the results, which the quotations are taken from."""
    for page in PAGES.glob("*.md"):
        (tmp_path / page.name).write_text(page.read_text())
    monkeypatch.setattr(quotations, "PAGES", tmp_path)
    return tmp_path


def change(page: Path, old: str, new: str) -> None:
    text = page.read_text()
    assert old in text
    page.write_text(text.replace(old, new))


@pytest.mark.parametrize("page", [ROOT / "README.md", PAGES / "README.md"], ids=["project", "results"])
def test_only_what_stands_between_the_lines_of_a_quotation_changes(page: Path, tmp_path: Path) -> None:
    copy = tmp_path / "README.md"
    copy.write_text(
        re.sub(r"(<!-- quoted \w+ -->\n).*?(<!-- end)", r"\1of last year\n\2", page.read_text(), flags=re.DOTALL)
    )
    assert "of last year" in copy.read_text()
    assert quotations.filled(copy) == page.read_text()


def test_a_new_measurement_makes_the_quotations_of_both_pages_old(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(export, "pages", dict)
    assert export.main(["--check"]) == 0
    scenarios = results / "scenarios.md"
    row = next(line for line in scenarios.read_text().splitlines() if line.startswith(ROW))
    whole_run, second_half = row.split("|")[2:4]
    change(scenarios, row, row.replace(whole_run, " 7 / 8 ", 1))
    assert export.main(["--check"]) == 0  # no page quotes the error over the whole run
    change(scenarios, "| 7 / 8 |" + second_half, "| 7 / 8 | 55.55 / 66.66 ")
    assert export.main(["--check"]) == 1
    assert capsys.readouterr().err.count("README.md") == 2
    assert "55.55 / 66.66" in quotations.filled(ROOT / "README.md")


def test_a_quotation_that_finds_nothing_is_an_error(results: Path) -> None:
    change(results / "performance.md", "tags are carried", "tags were carried")
    with pytest.raises(LookupError, match=r"performance\.md, capacity: nothing there matches"):
        quotations.filled(PAGES / "README.md")
    change(results / "performance.md", "<!-- end capacity -->", "")
    with pytest.raises(LookupError, match=r"performance\.md has no table capacity"):
        quotations.filled(PAGES / "README.md")
