"""The results as a table, as JSON, and between markers in a document."""

import json
import math
import os
import subprocess
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dropanchor_service.evaluation.product.rows import purpose
from dropanchor_service.evaluation.product.work import BATCH_S, Result

MARKER = "dropanchor evaluate product"
COLUMNS = (
    *("motion / sensors / told / start", "RMSE", "2nd half", "up to rotation", "lost", "tracking after", "never"),
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
    """Return the table, with what it says and where it comes from."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS), *(_line(result) for result in results)]
    return "\n".join([*lines, "", LEGEND, "", origin(seeds)])


def origin(seeds: range) -> str:
    when = datetime.now(UTC).strftime("%Y-%m-%d")
    return (
        f"Engine fleet, commit {_commit()}, {when}; seeds {seeds[0]} to {seeds[-1]} ({purpose(seeds)}); samples in "
        f"batches of {1e3 * BATCH_S:.0f} ms, all tags of a row in one engine. Recordings are development sets."
    )


def write_json(path: Path, results: Sequence[Result], seeds: range) -> None:
    """Write every figure of every row and tag. An infinite or missing number is null."""
    rows = {
        result.row.name: {**asdict(result.score), "by_tag": [asdict(tag) for tag in result.tags]} for result in results
    }
    text = {"origin": origin(seeds), "seeds": [seeds[0], seeds[-1]], "rows": rows}
    path.write_text(json.dumps(_finite(text), indent=1, allow_nan=False) + "\n")


def write_between_markers(path: Path, text: str) -> None:
    """Put the text between its markers in the document, which must have them or be new. Raises ValueError, OSError."""
    begin, end = f"<!-- {MARKER} -->", f"<!-- /{MARKER} -->"
    document = path.read_text(encoding="utf-8") if path.exists() else f"{begin}\n{end}\n"
    before, found, rest = document.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"{path} has no place for the table; put in two lines: {begin} and {end}")
    path.write_text(f"{before}{begin}\n\n{text}\n\n{end}{after}", encoding="utf-8")


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


def _commit() -> str:
    command = ["git", "-C", os.path.dirname(__file__), "describe", "--always", "--dirty", "--abbrev=9", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
