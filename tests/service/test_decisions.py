"""Each record of a decision is short, says what it must, and names tests that exist; each reference leads to one."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "service" / "docs" / "decisions"
RECORDS = sorted(FOLDER.glob("[0-9]*.md"))
PARTS = ("# ", "## Context", "## Decision", "## Consequences", "## What would make us reconsider", "Held by: ")
LINES, WIDTH = 40, 130
HELD = re.compile(r"`(?P<name>(?P<file>tests/[\w/.]+)(?:::(?P<test>\w+))?)`")
TAKES_IN = re.compile(r"^Takes in (?P<numbers>.*)\.$", re.MULTILINE)
LINK = re.compile(r"(?P<number>[0-9]+)\]\([^)]*?(?P<file>[0-9]{4})-[^)]*\.md\)")
REFERENCE = re.compile(r"\bdecision\s+(?P<number>[0-9]+)\b", re.IGNORECASE)


def number_of(record: Path) -> int:
    return int(record.name.partition("-")[0])


def taken_in(record: Path) -> list[int]:
    """Return the numbers of the records that are part of this one now."""
    found = TAKES_IN.search(record.read_text(encoding="utf-8"))
    return [] if found is None else [int(number) for number in re.findall(r"[0-9]+", found["numbers"])]


def faults(text: str) -> list[str]:
    """Return what a record lacks. A name of a test may make its line longer than others."""
    lines = text.splitlines()
    wrong = [f"{len(lines)} lines"] if len(lines) > LINES else []
    wrong += [f"too wide: {line}" for line in lines if len(line) > WIDTH and not line.startswith("`")]
    first = [next((i for i, line in enumerate(lines) if line.startswith(part)), -1) for part in PARTS]
    wrong += [f"no {part}" for part, line in zip(PARTS, first, strict=True) if line < 0]
    wrong += ["its parts are in another order"] if first != sorted(first) else []
    return wrong + _untrue(text.partition("Held by: ")[2])


def _untrue(held_by: str) -> list[str]:
    """Return which tests do not exist, of those that hold a record."""
    named = list(HELD.finditer(held_by))
    wrong = [f"no {one['name']}" for one in named if not _exists(one["file"], one["test"])]
    return wrong if named else ["it names no test"]


def _exists(file: str, test: str | None) -> bool:
    path = ROOT / file
    return path.is_file() and (test is None or f"def {test}(" in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.stem)
def test_a_record_is_short_and_names_the_tests_that_hold_it(record: Path) -> None:
    text = record.read_text(encoding="utf-8")
    assert text.startswith(f"# {number_of(record)}. ")
    assert faults(text) == []


def test_what_a_record_lacks_is_noticed() -> None:
    held_by = "Held by: `tests/gone.py`, `tests/conftest.py::gone`.\n"
    text = f"# 1. It\n\n## Decision\n\n## Context\n\n## Consequences\n\n{held_by}"
    assert faults(text + "\n" * LINES) == [
        "49 lines",
        "no ## What would make us reconsider",
        "its parts are in another order",
        "no tests/gone.py",
        "no tests/conftest.py::gone",
    ]


def test_the_index_has_each_record_once_with_its_title() -> None:
    index = (FOLDER / "README.md").read_text(encoding="utf-8")
    for record in RECORDS:
        title = record.read_text(encoding="utf-8").splitlines()[0].partition(". ")[2]
        assert index.count(f"| {number_of(record)} | [{title}]({record.name}) |") == 1, record.name
    assert len(re.findall(r"\]\([0-9]+-", index)) == len(RECORDS)


def test_a_number_belongs_to_one_record_and_every_reference_leads_to_one() -> None:
    numbers = [number_of(record) for record in RECORDS]
    of_others = [number for record in RECORDS for number in taken_in(record)]
    assert len(numbers + of_others) == len({*numbers, *of_others})
    for name, text in texts():
        assert [found[0] for found in REFERENCE.finditer(text) if int(found["number"]) not in numbers] == [], name
        assert [found[0] for found in LINK.finditer(text) if int(found["number"]) != int(found["file"])] == [], name


def texts() -> Iterator[tuple[str, str]]:
    """Yield the name and the text of every file that may refer to a record."""
    listed = subprocess.run(["git", "ls-files", "*.md", "*.py", "*.js"], cwd=ROOT, capture_output=True, check=True)
    for name in listed.stdout.decode().splitlines():
        if (ROOT / name).is_file():
            yield name, (ROOT / name).read_text(encoding="utf-8")
