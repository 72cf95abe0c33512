"""Walk through an operator's tasks on the page in German, and count clicks, keys, scrolls and seconds."""

from collections import defaultdict
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from benchmarks import report
from benchmarks.walk_place import WalkPlace, walk_place
from benchmarks.walk_tasks import Tasks
from benchmarks.walker import walked
from support.browser import WatchedPage, running_chromium, watched_page

pytestmark = pytest.mark.benchmark

SIZES = ((1440, 900), (1024, 768), (390, 844))
TAGS = (6, 60, 300)


def test_the_tasks_of_an_operator_at_three_sizes_with_few_and_many_tags(tmp_path: Path) -> None:
    cells: dict[tuple[int, str], list[str]] = defaultdict(list)
    works: dict[int, set[str]] = defaultdict(set)
    with running_chromium() as chromium:
        for tags in TAGS:
            (tmp_path / str(tags)).mkdir()
            with walk_place(tmp_path / str(tags), tags) as place:
                for size in SIZES:
                    for task, cell in walk(chromium, place, size, works[size[0]]).items():
                        cells[size[0], task].append(cell)
    assert any("not possible" not in cell for row in cells.values() for cell in row), (
        "no task can be done: the walk is broken"
    )
    report.record("walk", "\n\n".join(table(size, cells) for size in SIZES))


def walk(chromium: Browser, place: WalkPlace, size: tuple[int, int], works: set[str]) -> dict[str, str]:
    """Do every task on a page of this size, and return what each took."""
    found = {}
    with watched_page(chromium, f"{place.url}?lang=de", size=size, locale="de-DE") as page:
        for task, ways in Tasks(place, f"{size[0]}").all().items():
            found[task] = walked(page.page, ways, lambda: begin(page, place), works)
            print(f"{len(place.labels)} tags, {size[0]} px, {task}: {found[task]}", flush=True)
    return found


def begin(page: WatchedPage, place: WalkPlace) -> None:
    """Open the page anew, without what the task before has chosen."""
    page.page.goto("about:blank")
    page.page.goto(f"{place.url}?lang=de")
    page.wait_for(f"window.dropanchor?.status() === 'live' && dropanchor.tags().length === {len(place.labels)}")
    page.wait_for("dropanchor.drawing().still && document.getElementById('site')?.textContent !== ''")
    page.page.wait_for_timeout(150)  # what the key allows arrives with an answer of its own


def table(size: tuple[int, int], cells: dict[tuple[int, str], list[str]]) -> str:
    lines = [f"| {task} | {' | '.join(row)} |" for (width, task), row in cells.items() if width == size[0]]
    head = " | ".join(f"{tags} tags" for tags in TAGS)
    return "\n".join([f"At {size[0]} × {size[1]} px:", "", f"| task | {head} |", "|---|---|---|---|", *lines])
