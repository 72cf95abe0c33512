"""Run rows with each rule out, on the same samples as with all rules."""

import multiprocessing
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock
from typing import Final

from dropanchor_evaluation.ablation.rules import Rule
from dropanchor_evaluation.parallel import Workers, leave_interrupts_to_parent
from dropanchor_evaluation.product.rows import Row
from dropanchor_evaluation.product.runs import sources, tag_run
from dropanchor_evaluation.product.scores import TagScore
from dropanchor_evaluation.product.work import Task, score_tags, tasks
from dropanchor_service.estimation.fleet.engine import FleetEngine

SEEDS_PER_TASK: Final = 50  # the samples of so many tags are in memory at a time
CACHE: Final = "NUMBA_CACHE_DIR"
_environment = Lock()


@dataclass(frozen=True)
class Trial:
    """Rows that share their runs, and the rules that are taken out, one at a time; None: no rule is."""

    task: Task
    rules: tuple[Rule | None, ...]


@dataclass(frozen=True)
class Outcome:
    """The scores of some tags of a row without a rule, or with all of them (None)."""

    rule: str | None
    row: Row
    tags: list[TagScore]


def ablate(rows: Sequence[Row], seeds: range, rules: Sequence[Rule], processes: int) -> Iterator[list[Outcome]]:
    """Yield the outcomes of one piece of work after the other; `count_steps` says how many."""
    todo = _pieces(rows, seeds)
    tuned: tuple[Rule | None, ...] = (None, *(rule for rule in rules if not rule.constants))
    with Workers(processes) as workers:
        yield from workers.map(run_trial, [Trial(one, tuned) for one in todo])
    with ThreadPoolExecutor(processes) as threads:
        yield from threads.map(lambda rule: _in_its_own_process(rule, todo), _compiled(rules))


def count_steps(rows: Sequence[Row], seeds: range, rules: Sequence[Rule]) -> int:
    """Return how many times `ablate` yields."""
    return len(_pieces(rows, seeds)) + len(_compiled(rules))


def run_trial(trial: Trial) -> list[Outcome]:
    """Run the rows of a trial without each of its rules. Raises RecordingError."""
    runs = sources(trial.task.rows[0], trial.task.seeds)
    found = []
    for row in trial.task.rows:
        tags = [tag_run(row, one) for one in runs]
        for rule in trial.rules:
            scores, _ = score_tags(FleetEngine(rule.tuned() if rule else None), tags)
            found.append(Outcome(rule.name if rule else None, row, scores))
    return found


def run_without_constants(trial: Trial) -> list[Outcome]:
    """Run a trial of one rule that is in constants. Nothing of the engine was compiled in this process before."""
    for rule in trial.rules:
        if rule is not None:
            rule.take_constants_out()
    return run_trial(trial)


def _compiled(rules: Sequence[Rule]) -> list[Rule]:
    return [rule for rule in rules if rule.constants]


def _pieces(rows: Sequence[Row], seeds: range) -> list[Task]:
    """Return tasks of at most SEEDS_PER_TASK seeds. Recordings have no seeds, so they run once."""
    pieces = []
    for task in tasks(rows, seeds):
        parts = [seeds] if task.rows[0].folders else _parts(seeds)
        pieces += [Task(task.rows, part) for part in parts]
    return pieces


def _parts(seeds: range) -> list[range]:
    return [seeds[k : k + SEEDS_PER_TASK] for k in range(0, len(seeds), SEEDS_PER_TASK)]


def _in_its_own_process(rule: Rule, todo: Sequence[Task]) -> list[Outcome]:
    """Compile the engine without the rule, in a process and a cache of its own, and run all tasks there."""
    with tempfile.TemporaryDirectory(prefix="dropanchor-ablate-") as folder:
        with compiled_into(folder):
            pool = multiprocessing.get_context("spawn").Pool(1, leave_interrupts_to_parent)
        with pool:
            parts = pool.map(run_without_constants, [Trial(task, (rule,)) for task in todo])
    return [outcome for part in parts for outcome in part]


@contextmanager
def compiled_into(folder: str) -> Iterator[None]:
    """Let the processes that start meanwhile keep compiled code in a folder."""
    with _environment:
        before = os.environ.get(CACHE)
        os.environ[CACHE] = folder
        try:
            yield
        finally:
            os.environ.pop(CACHE)
            if before is not None:
                os.environ[CACHE] = before
