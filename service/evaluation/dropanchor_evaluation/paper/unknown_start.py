"""Tags with an unknown start: the time until an engine declares their position, and whether it is right."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np

from dropanchor_evaluation.paper.estimators import engines
from dropanchor_evaluation.paper.families import SEEDS_PER_TASK, Case, Task
from dropanchor_evaluation.paper.tuning import STATED
from dropanchor_evaluation.parallel import Workers
from dropanchor_evaluation.report import Section, Table
from dropanchor_evaluation.simulated import PriorKnowledge, truth_of
from dropanchor_service.answers.kernels.ageing import CHI2_95_OF_2
from dropanchor_service.estimation.columns import Array, State
from dropanchor_service.offline.accuracy import nees, truth_at
from dropanchor_service.offline.replay import Track
from dropanchor_tag_client.simulator.perturbations import perturbed
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate

CASES = (
    *(Case(family, "paper") for family in ("S5", "M5", "SG", "L1")),
    Case("M5", "paper", ("late15",)),
    Case("M5", "paper", ("hb0.1",)),
    Case("M5", "paper", ("nlosburst",)),
)
WRONG_M, WRONG_SHARE = 2.0, 0.1  # an error above both, the second of the range, is another place


@dataclass(frozen=True)
class RunScore:
    """The score of one run. "Right" means close to the truth, whether or not the state is tracking.

    declared_s: time from the first range to the first pose in state tracking; NaN: never. first_wrong: 1 if that pose
    was wrong; NaN: never declared. right_at_end: 1 if the last pose is right. rmse: m, over the positions of the second
    half. resolved_s: time to the first pose after which all poses are right; inf: none. coverage: of the 95 % ellipse
    while tracking. coverage_all, nees: over all poses with a position.
    """

    declared_s: float
    first_wrong: float
    right_at_end: float
    rmse: float
    resolved_s: float
    coverage: float
    coverage_all: float
    nees: float


@dataclass(frozen=True)
class Row:
    """Statistics over all runs. Times (s) and RMSE (m) are over the runs that have one.

    never: share of runs without a declaration. above_2m: share of runs with an RMSE above 2 m. nees_half: NEES / 2; 1
    for a consistent covariance.
    """

    never: float
    declared_median: float
    declared_p90: float
    first_wrong: float
    right_at_end: float
    rmse_median: float
    rmse_p90: float
    above_2m: float
    resolved_median: float
    resolved_p90: float
    coverage: float
    coverage_all: float
    nees_half: float


def tasks(seeds: range) -> list[Task]:
    starts = range(seeds.start, seeds.stop, SEEDS_PER_TASK)
    return [Task(case, range(first, min(first + SEEDS_PER_TASK, seeds.stop))) for case in CASES for first in starts]


def work(task: Task) -> dict[str, list[RunScore]]:
    models = perturbed(preset(task.case.preset), *task.case.perturbations)
    simulations = [simulate(task.case.family, seed, models) for seed in task.seeds]
    known = PriorKnowledge(start=False, heading_std=STATED.heading_std, exact_heading=task.case.exact_heading)
    found = {}
    for name, estimator in engines().items():
        tracks = estimator.run(simulations, known).tracks
        found[name] = [score(*run) for run in zip(simulations, tracks, strict=True)]
    return found


def score(simulation: Simulation, track: Track) -> RunScore:
    poses = track.poses
    true_x, true_y = truth_at(truth_of(simulation), track.t)
    error = np.column_stack([poses["x"] - true_x, poses["y"] - true_y])
    distance = np.hypot(*error.T)
    right = distance <= np.maximum(WRONG_M, WRONG_SHARE * np.hypot(true_x, true_y))
    tracking = poses["state"] == State.TRACKING
    first = int(np.argmax(tracking)) if tracking.any() else None
    second_half = distance[track.t > (track.t[0] + track.t[-1]) / 2]
    normalised = nees(error, poses["cov"][:, :2, :2])
    placed = np.isfinite(distance)
    inside = normalised <= CHI2_95_OF_2
    return RunScore(
        declared_s=np.nan if first is None else float(track.t[first] - track.t[0]),
        first_wrong=np.nan if first is None else float(not right[first]),
        right_at_end=float(right[-1]),
        rmse=_over_known(lambda known: float(np.sqrt(np.mean(known**2))), second_half),
        resolved_s=_resolved_s(track.t[placed], right[placed]),
        coverage=float(inside[tracking].mean()) if tracking.any() else np.nan,
        coverage_all=float(inside[placed].mean()) if placed.any() else np.nan,
        nees=_over_known(lambda known: float(np.mean(known)), normalised[placed]),
    )


def _resolved_s(t: Array, right: Array) -> float:
    """Return the time from the first instant to the one after which all poses are right; inf if there is none."""
    wrong = np.flatnonzero(~right)
    if not len(wrong):
        return 0.0
    return float(t[wrong[-1] + 1] - t[0]) if wrong[-1] + 1 < len(t) else np.inf


def summary(scores: Sequence[RunScore]) -> Row:
    column = {f.name: np.array([getattr(one, f.name) for one in scores]) for f in fields(RunScore)}

    def quantile(name: str, q: float) -> float:
        return _over_known(lambda known: float(np.quantile(known, q)), column[name])

    def mean(name: str) -> float:
        return _over_known(lambda known: float(np.mean(known)), column[name])

    return Row(
        never=float(np.isnan(column["declared_s"]).mean()),
        declared_median=quantile("declared_s", 0.5),
        declared_p90=quantile("declared_s", 0.9),
        first_wrong=mean("first_wrong"),
        right_at_end=mean("right_at_end"),
        rmse_median=quantile("rmse", 0.5),
        rmse_p90=quantile("rmse", 0.9),
        above_2m=float(np.mean(column["rmse"] > WRONG_M)),
        resolved_median=float(np.quantile(column["resolved_s"], 0.5, method="nearest")),
        resolved_p90=float(np.quantile(column["resolved_s"], 0.9, method="nearest")),
        coverage=mean("coverage"),
        coverage_all=mean("coverage_all"),
        nees_half=mean("nees") / 2,
    )


def run(workers: Workers, progress: Callable[[], None], seeds: range) -> Section:
    """Run all cases. progress: called after each of `tasks(seeds)`."""
    todo = tasks(seeds)
    scores: dict[str, dict[str, list[RunScore]]] = {case.name: {name: [] for name in engines()} for case in CASES}
    for task, found in zip(todo, workers.map(work, todo), strict=True):
        for name, runs in found.items():
            scores[task.case.name][name] += runs
        progress()
    rows = {case: {name: summary(runs) for name, runs in by.items()} for case, by in scores.items()}
    return Section(
        key="unknown_start",
        title="Unknown start",
        paper="The start is known.",
        finding=_finding(rows),
        text=[
            f"Seeds {seeds.start} to {seeds.stop - 1}, 0.2 m and 0.1 rad; the tag starts at rest, except in late15, "
            f"where it is in motion. In the right place: within {WRONG_M:.0f} m or {WRONG_SHARE:.0%} of the range of "
            "the truth. On one straight line (L1) the mirror image explains the same ranges: never declaring it is "
            "right. hb0.1: a heading reference that is wrong by 0.1 rad turns everything about the anchor, which "
            "nothing can see; nlosburst: four bursts of ranges that are too long. RMSE over the second half. The "
            "ellipse allows 0.1 rad for an error of the heading reference, which only hb0.1 has; the settings of a "
            "calibrated tag state that there is none, except in hb0.1. Algorithm 1 needs a start and is not in this "
            "table.",
        ],
        tables=[
            Table(
                "Declared: the state tracking",
                [
                    *("case", "engine", "never declared", "declared after, median s", "90 %"),
                    *("first declaration wrong", "right place at the end", "RMSE median, m", "90 %", "runs > 2 m"),
                    *("in the right place for good after, median s", "90 %"),
                    *("95 % coverage, tracking", "all", "NEES/2"),
                ],
                [[case, name, *asdict(row).values()] for case, by in rows.items() for name, row in by.items()],
            )
        ],
        results={case: {name: asdict(row) for name, row in by.items()} for case, by in rows.items()},
    )


def _finding(rows: dict[str, dict[str, Row]]) -> str:
    parts = []
    for case, by in rows.items():
        row = by["fleet"]
        after = "" if np.isnan(row.declared_median) else f" after {row.declared_median:.1f} s"
        wrong = "" if np.isnan(row.first_wrong) else f", {row.first_wrong:.0%} of them wrong"
        parts.append(f"{case}: declared in {1 - row.never:.0%}{after}{wrong}")
    return f"The engine fleet finds the start by itself (scalar sensors). {'; '.join(parts)}."


def _over_known(statistic: Callable[[Array], float], values: Array) -> float:
    known = values[np.isfinite(values)]
    return statistic(known) if len(known) else np.nan
