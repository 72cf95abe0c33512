"""Run an engine on a recording, with the same screening and the same `process` as live samples."""

from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.wire import anchor_number
from dropanchor_service.estimation.columns import HEADING, IMU, POSE, PRESSURE, RANGE, Array, SampleBatch, anchors_at
from dropanchor_service.estimation.fleet.smoother.smoothed import smoothed_poses
from dropanchor_service.estimation.fleet.smoother.trace import TracingEngine
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.ingest.decode import IMU_SAMPLE, SCALAR, Decoded
from dropanchor_service.ingest.kernels.packed import FORM
from dropanchor_service.ingest.screening import screen
from dropanchor_service.offline.accuracy import Truth
from dropanchor_tag_client.recording import Recording
from dropanchor_tag_client.recording.reading import FARTHEST_M

NS_PER_S = 1e9
STEP_S = 1.0
_STEP_NS = round(STEP_S * NS_PER_S)


@dataclass(frozen=True)
class Track:
    """The poses of an engine on a recording. t: (n,) s on the recording's clock; poses: POSE (n,), one per range.

    smoothed: bool (n,), which poses are smoothed and not as filtered; None: smoothing was not asked for.
    """

    t: Array
    poses: Array
    smoothed: Array | None = None


@dataclass(frozen=True)
class Samples:
    """The screened samples of a recording for row 0 of an engine.

    rejected: counts of rejected samples by reason. first: by reason, the file and line of the first one.
    zero_ns: time 0 of the batch on the clock of the recording.
    """

    batch: SampleBatch
    rejected: Counter[str]
    first: dict[str, str] = field(default_factory=dict)
    zero_ns: int = 0

    @property
    def start_s(self) -> float:
        return min(float(times[0]) for times in _times(self.batch) if len(times))

    @property
    def end_s(self) -> float:
        return max(float(times[-1]) for times in _times(self.batch) if len(times))


def anchors_of(recording: Recording) -> Array:
    """Return ANCHOR rows in the order of the recording's anchors."""
    return anchors_at(*((anchor.x, anchor.y, anchor.z) for anchor in recording.anchors))


def truth_of(recording: Recording) -> Truth | None:
    """Return the truth of a recording, or None if it has none."""
    columns = recording.truth
    t, x, y = (np.asarray(columns[name]) for name in ("t_s", "x", "y"))
    x, y = (np.where(np.abs(column) < FARTHEST_M, column, np.nan) for column in (x, y))
    return Truth(t, x, y) if len(t) > 1 else None


def samples_of(recording: Recording, anchors: Sequence[str]) -> Samples:
    """Return IMU samples, headings and the ranges to these anchors. Raises RecordingError if an anchor is missing."""
    numbers = {anchor_number(recording.anchor(anchor).id) for anchor in anchors}
    index = {anchor_number(anchor.id): i for i, anchor in enumerate(recording.anchors)}
    ranges = _scalars(recording.ranges, "range_m", "std_m")
    ranges["anchor"] = [anchor_number(anchor) for anchor in recording.range_anchors]
    ranges = ranges[np.isin(ranges["anchor"], list(numbers))]
    samples = Samples(SampleBatch(), Counter())
    imu = _screened(recording, "imu", _imu(recording.imu), samples).imu
    ranges = _screened(recording, "range", ranges, samples).ranges
    angles = _screened(recording, "heading", _scalars(recording.headings, "yaw_rad", "std_rad"), samples).headings
    fused, headings = np.zeros(len(ranges), RANGE), np.zeros(len(angles), HEADING)
    fused["t_ns"], fused["range"], fused["std"] = (ranges[name] for name in ("t_ns", "value", "std"))
    fused["anchor"] = [index[number] for number in ranges["anchor"].tolist()]
    headings["t_ns"], headings["heading"], headings["std"] = (angles[name] for name in ("t_ns", "value", "std"))
    imu["message"] = 0  # the row in the engine
    pressures = _pressures(recording, samples)
    batch = SampleBatch(imu=imu.view(IMU), ranges=fused, headings=headings, pressures=pressures)
    return replace(samples, batch=batch)


def _pressures(recording: Recording, samples: Samples) -> Array:
    """Return PRESSURE of row 0. Adds what no barometer measures to `samples`."""
    if not recording.pressures:
        return np.empty(0, PRESSURE)
    table = _scalars(recording.pressures, "pressure_pa", "temperature_c")
    measured = _screened(recording, "pressure", table, samples).pressures
    pressures = np.zeros(len(measured), PRESSURE)
    for name, column in (("t_ns", "t_ns"), ("pressure", "value"), ("temperature", "std")):
        pressures[name] = measured[column]
    return pressures


def replay(engine: Engine, anchors: Array, settings: Array, samples: Samples) -> Iterator[tuple[float, Array]]:
    """Feed row 0 of a fresh engine, one second of the recording at a time. Seconds without samples are skipped.

    anchors: ANCHOR; settings: TAG_SETTINGS (0-d). Yields the time reached, s, and the POSE rows of that second. Adds
    the engine's rejections to `samples.rejected`.
    """
    engine.set_anchors(anchors)
    engine.configure(0, settings)
    for second in np.unique(np.concatenate([t // _STEP_NS for t in _times_ns(samples.batch)])).tolist():
        batch = engine.process(_between(samples.batch, second * _STEP_NS, (second + 1) * _STEP_NS))
        samples.rejected.update({reason: len(rows) for reason, rows in batch.rejected.items()})
        yield min((second + 1) * _STEP_NS / NS_PER_S, samples.end_s), batch.poses


def track_of(steps: Sequence[Array], zero_ns: int = 0) -> Track:
    """Return the track of the POSE rows of consecutive steps. zero_ns: of the samples."""
    return _track(np.concatenate([np.empty(0, POSE), *steps]), zero_ns)


def _track(poses: Array, zero_ns: int) -> Track:
    poses["t_ns"] += zero_ns
    return Track(poses["t_ns"] / NS_PER_S, poses)


def smoothing_engine() -> Engine:
    """Return an engine whose track can be smoothed after `replay`."""
    return TracingEngine()


def smoothed(engine: Engine, lag_s: float | None, zero_ns: int = 0) -> Track:
    """Return the smoothed track of row 0. Each pose uses samples up to lag_s later; None: all samples.

    zero_ns: of the samples.

    Raises TypeError unless the engine is a `smoothing_engine`.
    """
    if not isinstance(engine, TracingEngine):
        raise TypeError(f"the engine {engine.name} does not support smoothing: use `smoothing_engine`")
    found = smoothed_poses(engine, 0, lag_s)
    return replace(_track(found.poses, zero_ns), smoothed=found.used)


def _between(batch: SampleBatch, start_ns: int, end_ns: int) -> SampleBatch:
    cuts = [np.searchsorted(samples["t_ns"], [start_ns, end_ns]) for samples in batch.columns()]
    return SampleBatch(*(samples[first:last] for samples, (first, last) in zip(batch.columns(), cuts, strict=True)))


def _times_ns(batch: SampleBatch) -> list[Array]:
    return [samples["t_ns"] for samples in batch.columns()]


def _times(batch: SampleBatch) -> list[Array]:
    return [t_ns / NS_PER_S for t_ns in _times_ns(batch)]


def _screened(recording: Recording, table: str, column: Array, samples: Samples) -> Decoded:
    """Return one table with the values that a sensor can have measured. Adds the others to `samples`."""
    no_imu, none = np.empty(0, IMU_SAMPLE), np.empty(0, SCALAR)
    columns = [column if table == kind.name else no_imu if kind is KINDS[0] else none for kind in KINDS]
    decoded, refused = screen(Decoded(*columns, forms=np.ones(1, FORM)))
    for group in refused:
        samples.rejected[group.reason] += len(group.messages)
        samples.first.setdefault(group.reason, recording.place(table, int(group.messages[0])))
    return decoded


def _imu(columns: dict[str, "array[float]"]) -> Array:
    imu = np.zeros(len(columns["t_s"]), IMU_SAMPLE)
    imu["t_ns"], imu["message"] = _t_ns(columns["t_s"]), np.arange(len(imu))
    for name, parts in (("acc", ("ax", "ay", "az")), ("gyro", ("gx", "gy", "gz")), ("mag", ("mx", "my", "mz"))):
        imu[name] = np.column_stack([np.asarray(columns[part]) for part in parts])
    return imu


def _scalars(columns: dict[str, "array[float]"], value: str, std: str) -> Array:
    scalars = np.zeros(len(columns["t_s"]), SCALAR)
    scalars["t_ns"], scalars["message"] = _t_ns(columns["t_s"]), np.arange(len(scalars))
    scalars["value"], scalars["std"] = np.asarray(columns[value]), np.asarray(columns[std])
    return scalars


def _t_ns(t_s: "array[float]") -> Array:
    ns: Array = np.rint(np.asarray(t_s) * NS_PER_S).astype(np.int64)
    return ns
