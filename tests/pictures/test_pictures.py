"""The README shows pictures of the page, and `make check` warns when they are old."""

import re
from pathlib import Path

import pytest
from PIL import Image

from dropanchor_evaluation.results import ROOT
from pictures import __main__ as program
from pictures.album import PAGE, pictures, record
from pictures.take import SCHEMES

MOST_BYTES = 150_000


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A page of pictures whose sources are one file."""
    page = tmp_path / "README.md"
    page.write_text("<!-- place for pictures -->\n")
    (tmp_path / "live-dark.webp").touch()
    (tmp_path / "page.js").write_text("show();\n")
    monkeypatch.setattr("pictures.album.ROOT", tmp_path)
    monkeypatch.setattr("pictures.album.SOURCES", ["page.js"])
    monkeypatch.setattr(program, "PAGE", page)
    return page


def test_the_readme_shows_every_picture_in_light_and_dark_and_each_is_small() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = {ROOT / name for name in re.findall(r'(?:src|srcset)="([^"]+)"', text)}
    assert shown == set(pictures(PAGE))
    assert {file.stem.split("-")[1] for file in shown} == set(SCHEMES)
    assert len(shown) == 4
    for file in shown:
        assert file.stat().st_size <= MOST_BYTES, file.name
        with Image.open(file) as picture:
            picture.load()


def test_a_change_of_the_page_warns_and_fails_nothing(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(page)
    assert "| [live-dark.webp](live-dark.webp) | six tags" in page.read_text()
    assert program.main(["--check"]) == 0
    assert capsys.readouterr().err == ""
    (page.parent / "page.js").write_text("hide();\n")
    assert program.main(["--check"]) == 0
    assert "make pictures" in capsys.readouterr().err
