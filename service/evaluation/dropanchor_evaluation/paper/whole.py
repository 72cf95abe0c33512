"""The whole report on the paper: all experiments, in the order of the paper."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dropanchor_evaluation import recordings
from dropanchor_evaluation.paper import (
    error_propagation,
    families,
    fig3,
    fig4,
    observability,
    robots,
    table1,
    unknown_start,
)
from dropanchor_evaluation.parallel import Workers
from dropanchor_evaluation.report import Section

TITLE = "Accurate position tracking with a single UWB anchor: the paper, reproduced"
Progress = Callable[[], None]


@dataclass(frozen=True)
class Plan:
    """The size of the report: numbers of seeds, which are 0, 1, …. anchors: per recording; None: all."""

    families: int = 100
    table1: int = 20
    fig4: int = 40
    robots: int = 10
    draws: int = 400_000
    anchors: int | None = None


FULL = Plan()
QUICK = Plan(families=4, table1=2, fig4=4, robots=1, draws=20_000, anchors=1)


@dataclass(frozen=True)
class Experiment:
    """One experiment of the report. steps: number of progress calls by `run`."""

    name: str
    steps: int
    run: Callable[[Progress], Section]


def experiments(plan: Plan, workers: Workers, data: Path) -> list[Experiment]:
    """Return all experiments. data: folder of the recordings, which may be missing."""
    seeds = range(plan.families)
    motions, starts = families.tasks(seeds), unknown_start.tasks(seeds)
    folders = recordings.recordings_in(data)
    of_robots = range(plan.robots)
    return [
        _one("observability", observability.run),
        _one("Fig. 3", fig3.run),
        _one("error propagation", lambda: error_propagation.run(plan.draws)),
        _one("Fig. 4", lambda: fig4.run(plan.fig4)),
        Experiment("Table I", table1.RUNS_PER_SEED * plan.table1, lambda step: table1.run(step, range(plan.table1))),
        Experiment("families", len(motions), lambda step: families.run(workers, step, seeds)),
        Experiment("unknown start", len(starts), lambda step: unknown_start.run(workers, step, seeds)),
        Experiment("robots", len(robots.tasks(of_robots)), lambda step: robots.run(workers, step, of_robots)),
        Experiment("recordings", len(folders), lambda step: recordings.run(workers, step, folders, plan.anchors)),
    ]


def preface(plan: Plan) -> Sequence[str]:
    return [
        "Cao, Yang, Li, Knoll, Beltrame, Accurate position tracking with a single UWB anchor, ICRA 2020: every "
        "experiment that needs none of its hardware, each beside what the paper says. Made by `dropanchor evaluate "
        "paper`; the same seeds give the same numbers, only processor times differ.",
        f"Seeds: Table I 0 to {plan.table1 - 1}, families and unknown start 0 to {plan.families - 1}, robots 0 to "
        f"{plan.robots - 1}, Fig. 4 400 to {399 + plan.fig4}. Tuned parameters of the EKF and of Algorithm 1: random "
        "search on scenario P, seeds 1000 to 1007, which no table uses; robots and recordings use the tuned set of the "
        "service instead. The engine fleet was developed with simulations and recordings of these kinds: for it they "
        "are no blind test.",
        *([QUICK_NOTE] if plan == QUICK else []),
    ]


QUICK_NOTE = (
    "This is a QUICK report: a handful of seeds and one anchor of each recording. It shows that everything runs; its "
    "medians, quantiles and shares mean little, and its times hold the compilation. Leave --quick out for the figures."
)


def _one(name: str, run: Callable[[], Section]) -> Experiment:
    def stepped(step: Progress) -> Section:
        section = run()
        step()
        return section

    return Experiment(name, 1, stepped)
