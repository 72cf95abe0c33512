"""The smoother beside the filter: the same tags, once as the engine publishes them and once with later samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dropanchor_evaluation.product.report import SOURCES, origin
from dropanchor_evaluation.product.rows import Row
from dropanchor_evaluation.product.runs import TagRun, sources, tag_run
from dropanchor_evaluation.product.scores import RowScore, TagScore, score, summary
from dropanchor_evaluation.product.work import run_tags
from dropanchor_evaluation.results import ROOT, Measured, write
from dropanchor_service.estimation.fleet.smoother.smoothed import smoothed_poses
from dropanchor_service.estimation.fleet.smoother.trace import TracingEngine
from dropanchor_service.offline.replay import NS_PER_S, Track

NAME = "smoothed"
LAG_S = 3.0
ROWS = (
    *("M5/scalar/everything/known", "M5/scalar/nothing/known", "M5/9-axis/nothing/known", "M5/scalar/nothing/unknown"),
    *("S5/6-axis/nothing/known", "forklift/scalar/everything/known"),
    *("walk-hand/scalar/nothing/known", "walk-hand/9-axis/nothing/known", "walk-turned/scalar/nothing/known"),
    *("mower/*/operator/known", "phones-front/*/known"),
)
COLUMNS = (
    *("motion / sensors / configured / start", "tags", "RMSE", "whole", "lag 3 s", "95 % ellipse holds", "worst"),
    *("tracking", "smoothed"),
)
LEGEND = (
    "RMSE in m over all poses, median / 90 % of the tags: filtered, smoothed with the whole track, and with a lag of "
    "3 s. Filtered, whole and lag: how often the 95 % ellipse holds the truth while tracking, the worst error in "
    "standard deviations, and the share of the time in state tracking. Smoothed: share of the poses that are, whole "
    "and lag; the others are as filtered."
)


@dataclass(frozen=True)
class Smoothed:
    """The scores of one row: filtered, smoothed with the whole track, smoothed with a lag.

    used: share of the poses that are smoothed, of the whole track and with a lag.
    """

    row: Row
    scores: tuple[RowScore, RowScore, RowScore]
    used: tuple[float, float]


@dataclass(frozen=True)
class Task:
    row: Row
    seeds: range


def work(task: Task) -> Smoothed:
    """Run the tags of a row, each in an engine of its own. Raises RecordingError."""
    runs = [tag_run(task.row, one) for one in sources(task.row, task.seeds)]
    tags, used = zip(*(_scores(run) for run in runs), strict=True)
    filtered, whole, lagged = (summary([tag[i] for tag in tags], 0.0) for i in range(3))
    of_whole, of_lagged = np.mean(used, axis=0).tolist()
    return Smoothed(task.row, (filtered, whole, lagged), (of_whole, of_lagged))


def _scores(run: TagRun) -> tuple[list[TagScore], list[float]]:
    """Return the scores of a tag as in `Smoothed`, and the shares of its poses that are smoothed."""
    engine = TracingEngine()
    filtered = run_tags(engine, [run])[0][0]
    later = [smoothed_poses(engine, 0, lag) for lag in (None, LAG_S)]
    tracks = [filtered, *(Track(one.poses["t_ns"] / NS_PER_S, one.poses) for one in later)]
    anchor = (float(run.anchors["x"][0]), float(run.anchors["y"][0]))
    scores = [score(run.name, track, run.truth, anchor, run.no_north) for track in tracks]
    return scores, [float(np.mean(one.used)) if len(one.used) else 0.0 for one in later]


def markdown(results: Sequence[Smoothed], seeds: range) -> str:
    """Return the table with its legend and origin."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS), *(_line(result) for result in results)]
    return "\n".join([*lines, "", LEGEND, "", origin(seeds)])


def write_into(page: Path, results: Sequence[Smoothed], seeds: range) -> None:
    """Write the table between its markers in a page of the project. Raises NoPlaceError, OSError."""
    write(ROOT, page, NAME, markdown(results, seeds), Measured(SOURCES, f"{seeds[0]}-{seeds[-1]}"))


def _line(result: Smoothed) -> str:
    cells = (
        result.row.name,
        str(result.scores[0].tags),
        *(f"{one.rmse[0]:.2f} / {one.rmse[1]:.2f}" for one in result.scores),
        " → ".join(f"{one.coverage:.3f}" for one in result.scores),
        " → ".join(f"{one.worst_sigma:.1f} σ" for one in result.scores),
        " → ".join(f"{one.tracking_share:.0%}" for one in result.scores),
        " / ".join(f"{share:.0%}" for share in result.used),
    )
    return "| " + " | ".join(cells) + " |"
