"""What an engineer may expect of a site: tables in two README files that quote the tables of results.

A table stands between the lines `<!-- quoted NAME -->` and `<!-- end NAME -->`. People write the rest of the page.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from dropanchor_evaluation.reference.goals_page import rows_of
from dropanchor_evaluation.reference.markdown import table
from dropanchor_evaluation.results import PAGES, ROOT, older

_BLOCK: Final = re.compile(r"(<!-- quoted (?P<name>\w+) -->\n).*?(<!-- end (?P=name) -->\n)", re.DOTALL)


@dataclass(frozen=True)
class Mover:
    """A kind of tag that moves in its own way, and its rows in the table of scenarios: its start known, and unknown."""

    what: str
    row: str


MOVERS: Final = (
    Mover("a vehicle that knows its heading, all told", "forklift/scalar/everything"),
    Mover("a vehicle with a 9-axis IMU, nothing told", "forklift/9-axis/nothing"),
    Mover("the same with a 6-axis IMU: no north, unless the start is told", "forklift/6-axis/nothing"),
    Mover("a slow cart with a 9-axis IMU, nothing told", "C5/9-axis/nothing"),
    Mover("something that rolls without vibration, as above", "rolling/9-axis/nothing"),
    Mover("a person with the tag in the hand, as above", "walk-hand/9-axis/nothing"),
    Mover("a person with the tag in a pocket, as above", "walk-pocket/9-axis/nothing"),
)


@dataclass(frozen=True)
class Cost:
    """A figure of a table of results. peer and reached: formats for the groups of `pattern`, found in that table."""

    what: str
    goal: str
    peer: str
    reached: str
    page: str
    table: str
    pattern: str


COSTS: Final = (
    Cost(
        "tags in one process, 110 samples/s each, on two cores with router and tags",
        "p99 of the latency ≤ 250 ms",
        "one filterpy EKF per tag without I/O: {1} times the processor time",
        "{0}",
        "performance.md",
        "capacity",
        r"\*\*(\d+) tags are carried.*?one filterpy EKF per tag, no I/O \| [\d.]+ \| ([\d.]+)",
    ),
    Cost(
        "age of a pose at three times as many tags",
        "≤ 1000 ms",
        "–",
        "{0} ms median, {1} ms at most",
        "performance.md",
        "overload",
        r"\| \d+ \| \d+ \| (\d+) / \d+ / (\d+) \|",
    ),
    Cost(
        "a service without tags",
        "0.5 % of a core",
        "–",
        "{0} % of a core, {1} MB",
        "performance.md",
        "small",
        r"Without tags: ([\d.]+) % of a core, (\d+) MB",
    ),
    Cost(
        "a service with 50 tags in 10 sites",
        "0.05 of a core, 150 MB",
        "receiving and dropping: {2} of a core",
        "{0} of a core, {1} MB",
        "performance.md",
        "small",
        r"50 tags in 10 sites: ([\d.]+) of a core, (\d+) MB.*?drops them: ([\d.]+) of",
    ),
    Cost(
        "one pose over REST",
        "–",
        "an empty answer: {0} ms",
        "{1} ms of processor time",
        "performance.md",
        "rest",
        r"live` ([\d.]+) ms, .*?pose` ([\d.]+) ms",
    ),
    Cost(
        "10,000 poses as JSON",
        "–",
        "msgspec: {1} times as long",
        "{0} ms of processor time",
        "performance.md",
        "pose-json",
        r"10,000 poses to JSON: ours ([\d.]+) ms .*?msgspec [\d.]+ ms \(([\d.]+) times",
    ),
    Cost(
        "10,000 moving tags on the page",
        "–",
        "100 tags: {0} frames/s",
        "{1} frames/s",
        "performance.md",
        "page",
        r"\| 100, live \|[^|]*\|[^|]*\|[^|]*\| ([\d.]+) \|.*?\| 10,000, live \|[^|]*\|[^|]*\|[^|]*\| ([\d.]+) \|",
    ),
    Cost(
        "10,000 tags among 100 zones",
        "–",
        "–",
        "{0} of a core",
        "performance.md",
        "zones",
        r"\| 10,000 × 100 \| [\d.]+ \| ([\d.]+) \|",
    ),
    Cost(
        "a shard of a cluster, beside `dropanchor serve`",
        "–",
        "`dropanchor serve`: 1.00",
        "{0} of its processor time",
        "cluster.md",
        "shard",
        r"\*\*([\d.]+) times as much\*\*",
    ),
    Cost(
        "silence of a site when all processes of a node die",
        "lease of 2 s",
        "a planned move: {0} s",
        "{1} s; each of {2} samples used once",
        "cluster.md",
        "cluster",
        r"planned move \| ([\d.]+) .*?all processes of a node \| ([\d.]+) .*?Each of ([\d,]+) samples was used once",
    ),
    Cost(
        "a tag with a DWM1001 on a computer",
        "5 % of a core, 30 MB",
        "–",
        "{1} % of a core, {0} MB",
        "tags.md",
        "sources",
        r"DWM1001` \|[^|]*\| \d+ \| ([\d.]+) \| ([\d.]+)%",
    ),
)


@dataclass(frozen=True)
class Tag:
    """What a tag may be. sources: rows of the table of costs; none: those of C. row: as of a mover."""

    what: str
    how: str
    sources: Sequence[str] | None
    row: str


TAGS: Final = (
    Tag(
        "a vehicle or robot that knows its heading",
        "[Python](tag_client/README.md), or any program that prints JSON",
        ("publish",),
        "forklift/scalar/everything",
    ),
    Tag(
        "a computer with a UWB module and a 9-axis IMU",
        "[`dropanchor-tag serial`, `dropanchor-tag imu`](tag_client/docs/devices.md)",
        ("serial, DWM1001", "imu"),
        "forklift/9-axis/nothing",
    ),
    Tag(
        "a microcontroller with both",
        "[one C file](tag_client/c/dropanchor.h), zenoh-pico",
        (),
        "forklift/9-axis/nothing",
    ),
    Tag(
        "devices with both that speak MQTT",
        "[`dropanchor-tag mqtt`](tag_client/docs/devices.md)",
        ("mqtt",),
        "C5/9-axis/nothing",
    ),
    Tag(
        "a robot with ROS 2 and a 6-axis IMU",
        "[`dropanchor ros2`](service/docs/how-to/connect-a-robot.md)",
        None,
        "forklift/6-axis/nothing",
    ),
    Tag(
        "a phone in a hand, with a UWB module",
        "[its browser, or an app](service/docs/how-to/connect-a-phone.md)",
        None,
        "walk-hand/9-axis/nothing",
    ),
)


def filled(page: Path) -> str:
    """Return the text of a page with its quotations as the results have them now. Raises OSError, KeyError."""
    return _BLOCK.sub(
        lambda found: f"{found[1]}\n{_TABLES[found['name']]()}\n{found[3]}", page.read_text(encoding="utf-8")
    )


def _block(page: str, name: str) -> str:
    """Return a table of results. Raises LookupError if it was never measured."""
    found = re.search(rf"<!-- results {name} .*?<!-- end {name} -->", (PAGES / page).read_text("utf-8"), re.DOTALL)
    if found is None:
        raise LookupError(f"{page} has no table {name}")
    return found[0]


def _movers() -> str:
    scenarios, bounds = (rows_of(_block("scenarios.md", name), name) for name in ("product", "bounds"))

    def cells(mover: Mover) -> Sequence[str]:
        known, unknown = (scenarios[f"{mover.row}/{start}"] for start in ("known", "unknown"))
        bound = bounds.get(f"{mover.row}/known", {}).get("efficient: 2nd half", "–")
        found = f"{unknown['tracking after']}; {unknown['never']} never"
        holds = min(known["95 % ellipse holds"], unknown["95 % ellipse holds"])
        return mover.what, known["2nd half"], bound, unknown["2nd half"], found, holds, f"`{mover.row}`"

    header = "a tag", "error, start known", "bound", "start unknown", "found after", "95 % ellipse holds", "rows"
    return table(header, map(cells, MOVERS))


def _costs() -> str:
    def cells(cost: Cost) -> Sequence[str]:
        found = re.search(cost.pattern, _block(cost.page, cost.table), re.DOTALL)
        if found is None:
            raise LookupError(f"{cost.page}, {cost.table}: nothing there matches {cost.pattern}")
        peer, reached = (text.format(*found.groups()) for text in (cost.peer, cost.reached))
        return cost.what, cost.goal, peer, reached, f"[{cost.table}]({cost.page})"

    return table(("what", "goal", "peer", "reached", "table"), map(cells, COSTS))


def _tags() -> str:
    scenarios = rows_of(_block("scenarios.md", "product"), "product")

    def cells(tag: Tag) -> Sequence[str]:
        known, unknown = (scenarios[f"{tag.row}/{start}"]["2nd half"] for start in ("known", "unknown"))
        return tag.what, tag.how, _cost_of(tag.sources), known, unknown, f"`{tag.row}`"

    header = "a tag may be", "it sends with", "which takes", "error in m, start known", "start unknown", "rows"
    return table(header, map(cells, TAGS))


def _cost_of(sources: Sequence[str] | None) -> str:
    if sources is None:
        return "–"
    if not sources:
        code, stack, rate = re.findall(r"(?:code|most|second) \| (\d+) B", _block("tags.md", "c"))
        return f"{code} B of code, {stack} B of stack, {rate} B/s"
    lines = [re.split(r" *\| *", line) for line in _block("tags.md", "sources").splitlines()]
    measured = {cells[1].strip("`"): cells for cells in lines if len(cells) > 7}
    parts = (f"{measured[name][4]} MB, {measured[name][5]} of a core, {measured[name][7]} B/s" for name in sources)
    return "; ".join(parts)


def _older() -> str:
    lines = [f"- [{page.name}]({page.name}): {', '.join(names)}\n" for page in _pages() if (names := older(ROOT, page))]
    return "".join(lines) or "None.\n"


def _pages() -> Sequence[Path]:
    return sorted(PAGES.glob("*.md"))


_TABLES: Final[dict[str, Callable[[], str]]] = {"movers": _movers, "costs": _costs, "tags": _tags, "older": _older}
