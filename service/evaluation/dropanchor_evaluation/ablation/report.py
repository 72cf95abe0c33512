"""What each rule buys, as a table: the errors without it against those with it."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dropanchor_evaluation.ablation.rules import RULES, Rule
from dropanchor_evaluation.ablation.work import Outcome
from dropanchor_evaluation.product.report import SOURCES
from dropanchor_evaluation.product.rows import CARRIED, Row
from dropanchor_evaluation.product.scores import TagScore
from dropanchor_evaluation.results import ROOT, Measured, write

NAME = "ablation"
KINDS = ("vehicles", "walks", "recordings")
BEYOND = 5.0  # standard deviations of a pose that lies
VISIBLE = {"vehicles": 0.01, "walks": 0.01, "recordings": 0.02}  # change of the error that can be seen
LIMITS = (0.01, 1e3)  # m, of an error that is compared: a track without a position has none
COLUMNS = (
    "rule",
    *(f"{kind}: {what}" for kind in KINDS for what in ("error", "worst row", "lies", "tracking")),
    "buys",
)
LEGEND = (
    "Without the rule against with it. Error: the change of the median and of the 90 % quantile over the tags of the "
    "RMSE of the second half, mean of the logarithms over the rows. Worst row: the row whose median grows most. Lies: "
    f"tags with a `tracking` pose beyond {BEYOND:.0f} standard deviations, with the rule and without it. Tracking: the "
    "change of its share of the time. A rule buys something where, without it, the median grows by more than 1 % "
    "(recordings: 2 %) or the quantile by twice that, where tags are `tracking` for so much less of the time, or more "
    "tags lie."
)

Tags = Mapping[tuple[str | None, Row], list[TagScore]]


@dataclass(frozen=True)
class Effect:
    """What taking a rule out does to rows of one kind. Ratios are those of the errors without it to with it."""

    median: float
    tail: float
    worst: float
    worst_row: str
    lies: int
    lies_without: int
    tracking: float

    def buys(self, kind: str) -> bool:
        """Return whether the rule can be seen to help."""
        seen = VISIBLE[kind]
        worse = math.log(self.median) > seen or math.log(self.tail) > 2 * seen or self.tracking < -seen
        return worse or self.lies_without > self.lies


def gathered(outcomes: Iterable[Outcome]) -> Tags:
    """Return the scores of all tags by rule and row."""
    found: dict[tuple[str | None, Row], list[TagScore]] = {}
    for one in outcomes:
        found.setdefault((one.rule, one.row), []).extend(one.tags)
    return found


def kind_of(row: Row) -> str:
    """Return which of KINDS a row is."""
    return "recordings" if row.folders else "walks" if row.scenario in CARRIED else "vehicles"


def effect(tags: Tags, rule: str, rows: Sequence[Row]) -> Effect:
    """Compare some rows without the rule with the same rows as they are."""
    medians, tails = ({row: _ratio(tags, rule, row, q) for row in rows} for q in (0.5, 0.9))
    worst = max(rows, key=lambda row: medians[row])
    with_it, without = ([one for row in rows for one in tags[name, row]] for name in (None, rule))
    return Effect(
        median=_mean(medians.values()),
        tail=_mean(tails.values()),
        worst=medians[worst],
        worst_row=worst.name,
        lies=_lies(with_it),
        lies_without=_lies(without),
        tracking=_tracking(without) - _tracking(with_it),
    )


def markdown(tags: Tags, rules: Sequence[Rule], seeds: range) -> str:
    """Return the table with its legend."""
    rows = {kind: [row for name, row in tags if name is None and kind_of(row) == kind] for kind in KINDS}
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    lines += [_line(tags, rule, rows) for rule in rules]
    names = ", ".join(f"`{row.name}`" for kind in KINDS[:2] for row in rows[kind])
    origin = (
        f"Seeds {seeds[0]} to {seeds[-1]}, {len(seeds)} a row: {names}; {len(rows['recordings'])} rows of recordings."
    )
    return "\n".join([*lines, "", LEGEND, "", origin])


def write_into(page: Path, text: str, seeds: range) -> None:
    """Write the table between its markers in a page of the project. Raises NoPlaceError, OSError."""
    write(ROOT, page, NAME, text, Measured(SOURCES, f"{seeds[0]}-{seeds[-1]}"))


def without_effect(tags: Tags) -> list[str]:
    """Return the rules that nothing shows to help."""
    rows = {kind: [row for name, row in tags if name is None and kind_of(row) == kind] for kind in KINDS}
    tried = {name for name, _ in tags}
    return [
        rule.name
        for rule in RULES
        if rule.name in tried and not any(effect(tags, rule.name, rows[k]).buys(k) for k in KINDS if rows[k])
    ]


def _line(tags: Tags, rule: Rule, rows: Mapping[str, Sequence[Row]]) -> str:
    effects = {kind: effect(tags, rule.name, rows[kind]) for kind in KINDS if rows[kind]}
    cells = [cell for kind in KINDS for cell in (_cells(effects[kind]) if kind in effects else ("–",) * 4)]
    bought = [kind for kind, one in effects.items() if one.buys(kind)]
    return "| " + " | ".join([rule.name, *cells, ", ".join(bought) or "nothing that can be seen"]) + " |"


def _cells(one: Effect) -> tuple[str, str, str, str]:
    worst = f"{one.worst - 1:+.0%} {one.worst_row}" if one.worst > 1.005 else "–"
    return (
        f"{one.median - 1:+.1%} / {one.tail - 1:+.1%}",
        worst,
        f"{one.lies} → {one.lies_without}",
        f"{one.tracking:+.1%}",
    )


def _ratio(tags: Tags, rule: str, row: Row, quantile: float) -> float:
    without, with_it = (
        np.quantile(np.clip([one.second_half for one in tags[name, row]], *LIMITS), quantile) for name in (rule, None)
    )
    return float(without / with_it)


def _mean(ratios: Iterable[float]) -> float:
    return float(np.exp(np.mean(np.log(list(ratios)))))


def _lies(tags: Sequence[TagScore]) -> int:
    return sum(one.worst_sigma > BEYOND for one in tags)


def _tracking(tags: Sequence[TagScore]) -> float:
    return float(np.mean([one.tracking_share for one in tags]))
