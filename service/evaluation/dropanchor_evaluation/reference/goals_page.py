"""The goals of the engine beside what the tables of results say: a page that is written from these tables."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Final

from dropanchor_evaluation.reference.markdown import table
from dropanchor_evaluation.results import PAGES

LEAST_COVERAGE, MOST_SIGMA = 0.93, 5.0
ABOUT: Final = """\
# What is not reached, and why

Goals of the engine, bounds and what it reaches, from the tables of [scenarios](scenarios.md) and
[bounds](scenarios.md#bounds): {seeds}. RMSE in m, median / 90 % of the tags. A bound is what an efficient engine has
that knows what the row tells; it does not count mirror images, or a reversal taken for driving ahead. There is none for
walks and recordings, and none for the time until a tag is declared. [What was tried](tried.md) is a page of its own.
"""
_PARTS: Final = "motion / sensors / configured / start"


@dataclass(frozen=True)
class Goal:
    """A goal for the error of a row. column: of the table of scenarios; why: what misses it, in one sentence."""

    row: str
    column: str
    median: float
    p90: float | None
    why: str


@dataclass(frozen=True)
class Honesty:
    """Rows whose ellipses should hold the truth. rows: patterns of their names."""

    name: str
    rows: Sequence[str]
    why: str


_WHOLE, _LATE = "RMSE", "2nd half"
_NORTH = (
    "most of the error is a rotation about the anchor: the mean acceleration of a vehicle tilts up, and a dip of "
    "64.5° makes twice that of north"
)
_SLIP = (
    "the engine cannot rule out a mount that slips by 0.02 rad; the bound has one that never does (with the slip: "
    "class rigid in the table of bounds)"
)
GOALS: Final = (
    Goal("S5/scalar/everything/known", _WHOLE, 0.17, 0.34, ""),
    Goal("M5/scalar/everything/known", _WHOLE, 0.17, 0.36, "by 0.01 m in the 90 % of few tags"),
    Goal(
        "P/scalar/everything/known",
        _WHOLE,
        0.19,
        0.28,
        "it turns sharply, with up to 50 m/s² sideways, and the bound takes the speed from that axis",
    ),
    Goal("S5-100Hz/scalar/everything/known", _WHOLE, 0.19, 0.42, ""),
    Goal("M5-100Hz/scalar/everything/known", _WHOLE, 0.19, 0.42, ""),
    Goal("P-100Hz/scalar/everything/known", _WHOLE, 0.19, 0.42, "as P above"),
    Goal("S5/scalar/everything/unknown", _LATE, 0.20, 0.55, "by 0.02 m in the median of few tags"),
    Goal("M5/scalar/everything/unknown", _LATE, 0.20, 0.55, "by 0.01 m in the 90 % of few tags"),
    Goal("forklift/scalar/mount/known", _WHOLE, 0.25, 0.6, ""),
    Goal("S5/scalar/nothing/known", _LATE, 0.36, None, _SLIP),
    Goal("M5/scalar/nothing/known", _LATE, 0.29, None, _SLIP),
    Goal("OU/scalar/nothing/known", _LATE, 0.23, None, "the mounting angle is found late by a tag that wanders"),
    Goal("C5/scalar/nothing/known", _LATE, 0.38, None, "the mounting angle is found late at a nearly constant speed"),
    Goal("S5/scalar/nothing/unknown", _LATE, 0.50, None, _SLIP),
    Goal("M5/scalar/nothing/unknown", _LATE, 0.38, None, _SLIP),
    Goal("OU/scalar/nothing/unknown", _LATE, 0.26, None, ""),
    Goal("C5/scalar/nothing/unknown", _LATE, 0.50, None, "as from a known start"),
    Goal("S5/9-axis/nothing/unknown", _LATE, 1.2, None, _NORTH),
    Goal("M5/9-axis/nothing/unknown", _LATE, 0.8, None, _NORTH),
    Goal("OU/9-axis/nothing/unknown", _LATE, 0.4, None, _NORTH),
    Goal("C5/9-axis/nothing/unknown", _LATE, 0.5, None, _NORTH),
    *(Goal(f"{motion}/6-axis/nothing/unknown", _LATE, 1.0, None, "") for motion in ("S5", "M5", "OU", "C5")),
    Goal(
        "S5/9-axis/everything/known",
        _WHOLE,
        0.40,
        None,
        "the heading is right to 0.02 rad, and 0.01 would be needed: tilt, gyroscope and iron alone cost little each, "
        "so one estimator would have to know them all, and the speed",
    ),
    Goal("M5/9-axis/everything/known", _WHOLE, 0.40, None, "as S5"),
)
_VEHICLES = tuple(
    f"{motion}{suffix}/*"
    for motion in ("P", "S5", "M5", "OU", "C5", "forklift")
    for suffix in ("", "-100Hz", "+[whlmno]*")
)
HONEST: Final = (
    Honesty(
        "vehicles",
        _VEHICLES,
        "errors of ranges that last, and the lag of a firmware that averages, are learned after some seconds only; "
        "single tags that pass near the anchor or cross the line of sight: linear updates take an error of the course "
        "for a lower speed there",
    ),
    Honesty(
        "a gyroscope that is worse than the prior says",
        ("*+bias*/*", "*+rested*/*", "*+gdrift/*"),
        "a rest of a second does not tell a bias above 0.05 rad/s from the slow turn of a hand; none is expected to "
        "swing by 0.03 rad/s within a minute",
    ),
    Honesty("smooth rolling", ("rolling/*", "rolling+mount*/*"), "a gyroscope that no rest teaches"),
    Honesty(
        "smooth rolling with an IMU that filters all vibration away",
        ("rolling+quiet/*",),
        "a ramp of the speed looks like a tilt at rest, and no hypothesis doubts a rest that the ranges contradict",
    ),
    Honesty("carried in the hand", ("walk-hand/*",), "with an unknown start few poses are `tracking`"),
    Honesty("in a pocket", ("walk-pocket/*",), "the direction of the steps of an upright device may be anything"),
    Honesty("turned on the way", ("walk-turned/*",), "a turn of the device is taken for one of the walker"),
    Honesty("Wi-Fi ranges", ("rtt_*",), "their errors are metres and last; the engine expects those of UWB"),
    Honesty("a drone that flies sideways", ("cf_*",), "no hypothesis lets a tag go sideways"),
    Honesty(
        "other recordings, as told by their operators",
        ("[!cr]*/recorded/operator/*",),
        "inrol is carried by hand, sideways, at 0.2 m/s",
    ),
    Honesty(
        "other recordings, nothing told",
        ("[!cr]*/recorded/nothing/*",),
        "a carried device (inrol), a tag that stands (mower), ranges 7 % too long (plaza2), phones that turn",
    ),
)


def page() -> str:
    """Return the page. Raises OSError if there is no page of scenarios."""
    text = (PAGES / "scenarios.md").read_text(encoding="utf-8")
    rows, bounds = rows_of(text, "product"), rows_of(text, "bounds")
    found = re.search(r'<!-- results product seeds="([\d-]+)"', text)
    seeds = f"seeds {found[1]}" if found else "no seeds yet"
    honest = [_honesty(one, rows) for one in HONEST if any(belongs_to(name, one) for name in rows)]
    return (
        ABOUT.format(seeds=seeds)
        + "\n## Accuracy\n\n"
        + table(("row", "measured", "goal", "bound", "reached", "why not"), _goals(rows, bounds))
        + f"\n## Honesty\n\nGoal: while a tag is `tracking`, its 95 % ellipse holds the truth in {LEAST_COVERAGE:.0%} "
        f"of the time at least in every row, and no pose is beyond {MOST_SIGMA:.0f} σ.\n\n"
        + table(("rows", "least coverage", f"rows within {MOST_SIGMA:.0f} σ", "worst pose", "why not"), honest)
    )


def rows_of(text: str, name: str) -> dict[str, dict[str, str]]:
    """Return the cells of a table of results by row and column: "who: this | that" is "who: this" and "who: that"."""
    block = re.search(rf"<!-- results {name} .*?<!-- end {name} -->", text, re.DOTALL)
    lines = [line for line in (block[0] if block else "").splitlines() if line.startswith("|")]
    found: dict[str, dict[str, str]] = {}
    header: list[str] = []
    for line in lines:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0] == _PARTS:
            header = _unique(cells)
        elif not cells[0].startswith("---"):
            found[cells[0]] = dict(zip(header, cells, strict=True))
    return found


def _unique(names: Sequence[str]) -> list[str]:
    """Return the names of columns, with who was named last."""
    who, found = "", []
    for name in names:
        who = name.partition(":")[0] + ": " if ":" in name else who
        found.append(name if ":" in name or not who else who + name)
    return found


def _goals(rows: Mapping[str, Mapping[str, str]], bounds: Mapping[str, Mapping[str, str]]) -> Iterator[tuple[str, ...]]:
    for goal in GOALS:
        if goal.row not in rows:
            continue
        reached = rows[goal.row][goal.column]
        bound = bounds.get(goal.row, {}).get(f"efficient: {goal.column}", "–")
        wanted = f"{goal.median:.2f}" + (f" / {goal.p90:.2f}" if goal.p90 is not None else "")
        why = "reached" if _is_reached(goal, reached) else goal.why
        yield goal.row, "whole run" if goal.column == _WHOLE else "second half", wanted, bound, reached, why


def _is_reached(goal: Goal, reached: str) -> bool:
    median, _, p90 = reached.partition(" / ")
    return float(median) <= goal.median and (goal.p90 is None or float(p90) <= goal.p90)


def belongs_to(row: str, honesty: Honesty) -> bool:
    """Return whether a row is one of a group."""
    return any(fnmatchcase(row, pattern) for pattern in honesty.rows)


def _honesty(one: Honesty, rows: Mapping[str, Mapping[str, str]]) -> tuple[str, ...]:
    own = {name: cells for name, cells in rows.items() if belongs_to(name, one) and cells["95 % ellipse holds"] != "–"}
    coverage = {name: float(cells["95 % ellipse holds"]) for name, cells in own.items()}
    sigma = {name: float(cells["worst"].removesuffix(" σ")) for name, cells in own.items()}
    least, worst = min(coverage, key=coverage.__getitem__), max(sigma, key=sigma.__getitem__)
    within = sum(value <= MOST_SIGMA for value in sigma.values())
    reached = coverage[least] >= LEAST_COVERAGE and within == len(own)
    return (
        one.name,
        f"{coverage[least]:.3f} ({least})",
        f"{within} of {len(own)}",
        f"{sigma[worst]:.1f} σ ({worst})",
        "reached" if reached else one.why,
    )
