"""Names of code in the pages for people: a how-to that names a file which has moved leads nowhere."""

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [
    *sorted((ROOT / "service" / "docs" / "how-to").glob("*.md")),
    *sorted((ROOT / "service" / "docs" / "explanation").glob("*.md")),
    *sorted((ROOT / "tag_client" / "docs").glob("*.md")),
]
FILE = re.compile(r"`(?P<file>[\w./-]+\.(?:py|js|mjs|c|h))`")
FOLDER = re.compile(r"`(?P<folder>(?:belief|frontend|smoother|estimation|ingest|answers)/[\w/]*)`")
NAME = re.compile(r"`(?P<name>\w+)(?:\(\))?` in\s+(?:the\s+)?\[?`(?P<file>[\w./-]+\.(?:py|js|mjs|c|h))`")
# Files that a page tells its reader to write, or that other people wrote.
NOT_OURS = {"requests_of_a_day.py", "with_pandas.py", "with_duckdb.py", "to_s3.py", "cmd_fn.c"}


@cache
def files() -> tuple[str, ...]:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    return tuple(listed.stdout.splitlines())


def found(name: str) -> list[str]:
    """Return the files of the project whose path ends with a name."""
    return [path for path in files() if f"/{path}".endswith(f"/{name}")]


def wrong_names(text: str) -> list[str]:
    """Return what a page says of the code that is not so."""
    wrong = [f"there is no {one}" for one in FILE.findall(text) if one not in NOT_OURS and not found(one)]
    for folder in FOLDER.findall(text):
        known = f"/{folder.rstrip('/')}"
        if not any(f"{known}/" in f"/{path}" or f"/{path}".endswith(f"{known}.py") for path in files()):
            wrong.append(f"there is no {folder}")
    for one in NAME.finditer(text):
        inside = re.compile(rf"\b{one['name']}\b")
        places = found(one["file"])
        if places and not any(inside.search((ROOT / place).read_text(encoding="utf-8")) for place in places):
            wrong.append(f"{one['name']} is not in {one['file']}")
    return wrong


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_code_that_a_page_names_exists(page: Path) -> None:
    assert wrong_names(page.read_text(encoding="utf-8")) == []


def test_stale_names_are_noticed() -> None:
    text = "Look at `gone.py`, `belief/gone` and `nothing_here` in `belief/step.py`, and `advance` in `belief/step.py`."
    assert wrong_names(text) == [
        "there is no gone.py",
        "there is no belief/gone",
        "nothing_here is not in belief/step.py",
    ]
