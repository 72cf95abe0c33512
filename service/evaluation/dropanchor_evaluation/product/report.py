"""Write the results as a table, as JSON, and between markers in a page."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dropanchor_evaluation.product.rows import purpose
from dropanchor_evaluation.product.work import BATCH_S, Result
from dropanchor_evaluation.results import ROOT, Measured, commit, write

NAME = "product"
SOURCES = ("service/dropanchor_service/estimation", "tag_client/dropanchor_tag_client/simulator")
COLUMNS = (
    *("motion / sensors / configured / start", "RMSE", "2nd half", "up to rotation", "lost", "tracking after", "never"),
    *("tracking", "95 % ellipse holds", "worst", "µs"),
)
LEGEND = (
    "RMSE in m, median / 90 % of the tags: over all poses, over the second half of the time, and that after the best "
    "rotation about the anchor. With an unknown start, rows of 6 axes and recordings with an IMU are judged up to a "
    "rotation throughout. Lost: more than 2 m off at the end. Tracking after: median time until the first pose in that "
    "state; never: share of the tags without one; tracking: share of the time. While tracking: how often the 95 % "
    "ellipse holds the truth, and the worst error in standard deviations. µs: processor time of the engine per tag and "
    "second, which falls with the number of tags."
)


def markdown(results: Sequence[Result], seeds: range) -> str:
    """Return the table with its legend and origin."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS), *(_line(result) for result in results)]
    return "\n".join([*lines, "", LEGEND, "", origin(seeds)])


def origin(seeds: range) -> str:
    """Return a sentence on the runs behind the table."""
    return (
        f"Engine fleet; seeds {seeds[0]} to {seeds[-1]} ({purpose(seeds)}); samples in batches of "
        f"{1e3 * BATCH_S:.0f} ms, all tags of a row in one engine. Recordings are development sets."
    )


def write_json(path: Path, results: Sequence[Result], seeds: range) -> None:
    """Write all figures of all rows and tags as JSON. An infinite or missing number is null."""
    rows = {
        result.row.name: {**asdict(result.score), "by_tag": [asdict(tag) for tag in result.tags]} for result in results
    }
    text = {"commit": commit(ROOT), "origin": origin(seeds), "seeds": [seeds[0], seeds[-1]], "rows": rows}
    path.write_text(json.dumps(_finite(text), indent=1, allow_nan=False) + "\n")


def write_into(page: Path, results: Sequence[Result], seeds: range) -> None:
    """Write the table between its markers in a page of the project. Raises NoPlaceError, OSError."""
    write(ROOT, page, NAME, markdown(results, seeds), Measured(SOURCES, f"{seeds[0]}-{seeds[-1]}"))


def _line(result: Result) -> str:
    one = result.score
    cells = (
        result.row.name,
        *(f"{_m(median)} / {_m(p90)}" for median, p90 in (one.rmse, one.second_half, one.rotated)),
        f"{one.lost:.0%}",
        "–" if math.isinf(one.tracking_after_s) else f"{one.tracking_after_s:.1f} s",
        f"{one.never:.0%}",
        f"{one.tracking_share:.0%}",
        "–" if math.isnan(one.coverage) else f"{one.coverage:.3f}",
        "–" if math.isnan(one.worst_sigma) else f"{one.worst_sigma:.1f} σ",
        f"{one.us:.0f}",
    )
    return "| " + " | ".join(cells) + " |"


def _m(value: float) -> str:
    return "–" if math.isinf(value) else f"{value:.2f}"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
