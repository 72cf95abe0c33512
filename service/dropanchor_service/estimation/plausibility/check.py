"""Check the samples of all tags before an estimator sees them."""

from dataclasses import dataclass, field

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, SampleBatch, State, StateReason
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.plausibility.imu import add_absurd, add_imu
from dropanchor_service.estimation.plausibility.layout import CHECK, DOUBTS, Check, make_checks
from dropanchor_service.estimation.plausibility.ranges import AVERAGED, add_absurd_range, add_range
from dropanchor_service.estimation.plausibility.verdicts import VIGOROUS, Finding, ImuVerdict, findings

AVERAGED_STD = 0.3  # m, of a mean of ranges: its errors are not independent, so that each counts less


def _no_rows() -> Array:
    return np.empty(0, np.int32)


@dataclass(frozen=True)
class Checked:
    """samples: those that may be used. poses: POSE of the tags whose samples may not.

    left_out: the row of each sample that may not be used, for every kind. failed: rows that have just failed, so that
    their estimate is worth nothing. found: rows of these samples with a fault, and those that have just lost one.
    """

    samples: SampleBatch
    poses: Array = field(default_factory=lambda: np.empty(0, POSE))
    left_out: tuple[Array, ...] = ()
    failed: Array = field(default_factory=_no_rows)
    found: Array = field(default_factory=_no_rows)


class SensorCheck:
    """The checks of all tags. Owned by one thread. The same samples get the same verdicts, however they are cut into
    batches; the first batch with a fault is left out as a whole."""

    def __init__(self) -> None:
        self._checks = make_checks(0)
        self._unusable = self._faulty = np.zeros(0, bool)  # by row, when the last batch was checked
        self._absurd = False  # whether samples that no sensor can have measured have changed a verdict since

    @property
    def columns(self) -> Array:
        """CHECK by row."""
        return self._checks

    @columns.setter
    def columns(self, columns: Array) -> None:
        self._checks = columns.astype(CHECK)
        self._unusable, self._faulty = _is_unusable(self._checks), _has_fault(self._checks)

    def start(self, row: int, sign_told: bool = False) -> None:
        """Begin anew for this row. sign_told: the operator says which way accelerations point."""
        self.reserve(row + 1)
        self._checks[row] = np.zeros((), CHECK)
        self._checks[row]["sign_known"] = sign_told
        self._unusable[row] = self._faulty[row] = False

    def findings(self, row: int) -> list[Finding]:
        """Return what is wrong with the sensors of this row."""
        return findings(self._checks[row])

    def unjudged(self, row: int) -> list[Finding]:
        """Return why the sensors of this row, of which nothing wrong is known, are not judged now."""
        check = self._checks[row]
        is_vigorous = check["imu_verdict"] == ImuVerdict.GOOD and check["vigorous_s"] > 0.0
        return [VIGOROUS] if is_vigorous else []

    def note_absurd(self, imu_rows: Array, imu_sizes: Array, range_rows: Array) -> None:
        """Note samples that no sensor can have measured. imu_sizes: the greatest value of each."""
        self.reserve(1 + int(max(imu_rows.max(initial=-1), range_rows.max(initial=-1))))
        self._absurd |= note_absurd(self._checks, imu_rows, imu_sizes, range_rows)

    def check(self, samples: SampleBatch) -> Checked:
        """Judge the sensors with these samples, and return those samples that may be used.

        Every row must have been started: looking for new ones would cost as much as to judge.
        """
        changed = judge(self._checks, samples.imu, samples.ranges)
        if not changed and not self._absurd and not self._faulty.any():
            return Checked(samples)
        return self._checked(samples)

    def _checked(self, samples: SampleBatch) -> Checked:
        rows = np.unique(np.concatenate([column["row"] for column in samples.columns()]))
        self.reserve(1 + int(rows.max(initial=-1)))
        faulty, unusable = _has_fault(self._checks), _is_unusable(self._checks)
        was_faulty, was_unusable = self._faulty, self._unusable
        self._faulty, self._unusable, self._absurd = faulty, unusable, False
        found = rows[faulty[rows] | was_faulty[rows]]
        left = [unusable[column["row"]] for column in samples.columns()]
        left_out = tuple(column["row"][out] for column, out in zip(samples.columns(), left, strict=True))
        kept = SampleBatch(*(column[~out] for column, out in zip(samples.columns(), left, strict=True)))
        failed = rows[unusable[rows] & ~was_unusable[rows]]
        return Checked(self._widened(kept), _poses_of(samples, unusable), left_out, failed, found)

    def _widened(self, samples: SampleBatch) -> SampleBatch:
        """Give ranges that a module averages the standard deviation that lasting errors need."""
        averaged = (self._checks["range_verdict"] == AVERAGED)[samples.ranges["row"]]
        if not averaged.any():
            return samples
        ranges = samples.ranges.copy()
        ranges["std"][averaged] = np.fmax(ranges["std"][averaged], AVERAGED_STD)
        return SampleBatch(samples.imu, ranges, *samples.columns()[2:])

    def mark(self, poses: Array) -> None:
        """Take `tracking` from POSE of tags whose sensors are in doubt, in place."""
        if not len(poses) or not self._faulty.any():
            return
        doubtful = self._faulty[poses["row"]]
        poses["state"][doubtful & (poses["state"] == State.TRACKING)] = State.DEGRADED
        poses["reason"][doubtful] = StateReason.SENSOR_FAULT

    def reserve(self, rows: int) -> None:
        """Make room for this many rows."""
        if rows > len(self._checks):
            more = make_checks(max(rows, 2 * len(self._checks)))
            more[: len(self._checks)] = self._checks
            self._checks = more
            self._faulty, self._unusable = (
                np.concatenate([known, np.zeros(len(more) - len(known), bool)])
                for known in (self._faulty, self._unusable)
            )


@njit(cache=True, nogil=True)
def judge(checks: Array, imu: Array, ranges: Array) -> bool:
    """Add the samples to the checks of their rows. Return whether a row may fail now, or no more."""
    changed = False
    first = 0
    while first < len(imu):
        row, end = imu[first].row, first + 1
        while end < len(imu) and imu[end].row == row:
            end += 1
        check = _of_row(checks, row)
        before = check.imu_verdict
        add_imu(check, imu, first, end)
        changed = changed or check.imu_verdict != before
        first = end
    for i in range(len(ranges)):
        sample = ranges[i]
        check = _of_row(checks, sample.row)
        before = check.range_verdict
        add_range(check, sample.t_ns, sample.anchor, sample.range)
        changed = changed or check.range_verdict != before
    return changed


@njit(nogil=True)
def _of_row(checks: Array, row: int) -> Check:
    if row >= len(checks):
        raise IndexError("a row that was not started")
    return checks[row]


@njit(cache=True, nogil=True)
def note_absurd(checks: Array, imu_rows: Array, imu_sizes: Array, range_rows: Array) -> bool:
    """Note samples that no sensor can have measured. Return whether that has changed a verdict."""
    changed = False
    for i in range(len(imu_rows)):
        check = checks[imu_rows[i]]
        before = check.imu_verdict
        add_absurd(check, imu_sizes[i])
        changed = changed or check.imu_verdict != before
    for i in range(len(range_rows)):
        check = checks[range_rows[i]]
        before = check.range_verdict
        add_absurd_range(check)
        changed = changed or check.range_verdict != before
    return changed


def _has_fault(checks: Array) -> Array:
    """Return for each row whether something is wrong with its sensors."""
    faulty: Array = (checks["imu_verdict"] > 0) | (checks["range_verdict"] > 0)
    return faulty


def _is_unusable(checks: Array) -> Array:
    """Return for each row whether its samples may not be used."""
    imu, ranges = checks["imu_verdict"], checks["range_verdict"]
    unusable: Array = ((imu > 0) & (imu < DOUBTS)) | ((ranges > 0) & (ranges != AVERAGED))
    return unusable


def _poses_of(samples: SampleBatch, unusable: Array) -> Array:
    """Return one POSE, without a position, for each row whose samples may not be used."""
    out = [column[unusable[column["row"]]] for column in samples.columns()]
    rows, place = np.unique(np.concatenate([column["row"] for column in out]), return_inverse=True)
    times = np.zeros(len(rows), np.int64)
    np.maximum.at(times, place, np.concatenate([column["t_ns"] for column in out]))
    poses = np.zeros(len(rows), POSE)
    for name in POSE.names or ():
        if poses[name].dtype.kind == "f":
            poses[name] = np.nan
    poses["row"], poses["t_ns"] = rows, times
    poses["anchor"], poses["state"], poses["reason"] = -1, State.INITIALISING, StateReason.SENSOR_FAULT
    return poses
