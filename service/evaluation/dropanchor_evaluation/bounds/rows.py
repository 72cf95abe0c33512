"""The bounds of a row of the product's evaluation, run by run."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dropanchor_evaluation.bounds.linear import LinearModel
from dropanchor_evaluation.bounds.vehicle import (
    ANY_ANGLE,
    ANY_PLACE,
    ANY_SPEED,
    Knowledge,
    Motion,
    raw_model,
    scalar_model,
)
from dropanchor_evaluation.pcrb import Path
from dropanchor_evaluation.product.rows import CARRIED, Row, simulated_rows
from dropanchor_evaluation.product.runs import sensor_models, sources
from dropanchor_evaluation.product.work import Task
from dropanchor_evaluation.simulated import START_STD
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.belief.rigidity import RIGID_SLIP
from dropanchor_service.estimation.fleet.configure import SLIP_UNKNOWN_STD, SLIP_UNKNOWN_TAU, START_HEADING_STD
from dropanchor_tag_client.simulator.simulation import Simulation

DRAWS, DRAWS_TO_ROTATE = 4, 16
"""Efficient estimators of a run. The bound up to a rotation is the mean square of their errors."""


@dataclass(frozen=True)
class RunBound:
    """The bound of one run over the whole run and over its second half: root mean square of the position, m.

    efficient: the same of efficient estimators, (draws, 3): whole run, second half, and that after the best
    rotation about the anchor.
    """

    whole: float
    second_half: float
    efficient: Array


@dataclass(frozen=True)
class RowBound:
    """The bounds of the runs of a row: of a mount that never slips, as in the simulation, and of one that may slip.

    class_rigid, class_loose: slip as much as the engine assumes of its two classes of mounts. Both are empty where the
    mounting angle is told.
    """

    row: Row
    never_slips: Sequence[RunBound]
    class_rigid: Sequence[RunBound]
    class_loose: Sequence[RunBound]


def bounded_rows() -> list[Row]:
    """Return the rows of vehicles. A mount that is told is rigid, so `mount` has the bound of `everything`."""
    return [row for row in simulated_rows() if row.scenario not in CARRIED and row.configured != "mount"]


def work(task: Task) -> list[RowBound]:
    """Return the bounds of the rows of a task."""
    runs = [one for one in sources(task.rows[0], task.seeds) if isinstance(one, Simulation)]
    return [row_bound(row, runs) for row in task.rows]


def row_bound(row: Row, runs: Sequence[Simulation]) -> RowBound:
    """Return the bounds of a row in these runs."""
    known = knowledge(row)

    def bounds(slip: float) -> list[RunBound]:
        return [run_bound(row, run, replace(known, slip=slip, slip_tau=SLIP_UNKNOWN_TAU)) for run in runs]

    classes = [bounds(slip) if known.mount else [] for slip in (RIGID_SLIP, SLIP_UNKNOWN_STD)]
    return RowBound(row, bounds(0.0), *classes)


def knowledge(row: Row) -> Knowledge:
    """Return what is known of the tags of a row.

    Without north, an unknown start is judged up to a rotation, so the direction to the start is given instead.
    """
    known = row.start == "known"
    return Knowledge(
        start=START_STD if known else ANY_PLACE,
        bearing=not known and row.sensors == "6-axis",
        yaw=START_HEADING_STD if known and row.sensors != "scalar" else ANY_ANGLE,
        speed=Knowledge.speed if known else ANY_SPEED,
        mount=ANY_ANGLE if row.configured == "nothing" else 0.0,
    )


def run_bound(row: Row, run: Simulation, known: Knowledge) -> RunBound:
    """Return the bound of one run."""
    motion = motion_of(run)
    t = motion.path.t
    bound = _model(row, motion, known).bound(DRAWS_TO_ROTATE if known.bearing else DRAWS, run.seed)
    late = t >= (t[0] + t[-1]) / 2
    rotated = _rotated(bound.errors, motion.path, late)
    efficient = np.column_stack([_rms(bound.errors), _rms(bound.errors[late]), _rms(rotated[late])])
    if known.bearing:  # no frame but the best one
        efficient[:, 0], efficient[:, 1] = _rms(rotated), efficient[:, 2]
        return RunBound(_root_mean(efficient[:, 0] ** 2), _root_mean(efficient[:, 1] ** 2), efficient)
    return RunBound(_root_mean(bound.position), _root_mean(bound.position[late]), efficient)


def motion_of(run: Simulation) -> Motion:
    """Return the true motion of a run, with ranges at the instants of the run's own."""
    truth = run.truth
    ranged = np.zeros(len(truth.t_s), bool)
    ranged[np.searchsorted(truth.t_s, run.ranges.t_s - 1e-6)] = True
    path = Path(truth.t_s, truth.x, truth.y, truth.course, truth.v, ranged)
    return Motion(path, truth.w, float(truth.course[0] - truth.heading[0]))


def _model(row: Row, motion: Motion, known: Knowledge) -> LinearModel:
    models = sensor_models(row)
    if row.sensors == "scalar":
        return scalar_model(motion, models, known)
    return raw_model(motion, models, known, magnetometer=row.sensors != "6-axis")


def _rotated(errors: Array, path: Path, used: Array) -> Array:
    """Return the errors (n, draws, 2) after the small rotation about the anchor that makes the used ones smallest."""
    turn = np.column_stack([-path.y, path.x])
    angle = np.einsum("nij,nj->i", errors[used], turn[used]) / np.sum(turn[used] ** 2)
    rotated: Array = errors - angle[None, :, None] * turn[:, None, :]
    return rotated


def _rms(errors: Array) -> Array:
    """Return the root mean square over time of each draw, (draws,)."""
    rms: Array = np.sqrt(np.mean(np.sum(errors**2, axis=2), axis=0))
    return rms


def _root_mean(squares: Array) -> float:
    return float(np.sqrt(np.mean(squares)))
