"""Check the sensors of a recording as those of a live tag are checked, and a little better: the end is known, too."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dropanchor_schemas.rejections import Reason
from dropanchor_service.estimation.columns import Array, PoseBatch, SampleBatch
from dropanchor_service.estimation.plausibility.check import SensorCheck
from dropanchor_service.estimation.plausibility.layout import CHECK, DOUBTS
from dropanchor_service.estimation.plausibility.recorded import in_steps
from dropanchor_service.estimation.plausibility.verdicts import Finding, ImuVerdict, RangeVerdict
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.offline.replay import NS_PER_S, Samples

EARLY_S = 60.0
MOSTLY = 0.3  # share of samples that no sensor can have measured


class CheckedEngine:
    """An engine whose samples pass the check of the sensors first. Row 0 alone.

    found: what was wrong, by name, with the time from which on it was known, s.
    """

    def __init__(self, engine: Engine, known: Array | None = None) -> None:
        """known: CHECK (0-d) with the verdicts that hold from the start."""
        self.name = engine.name
        self.found: dict[str, tuple[float, Finding]] = {}
        self._engine = engine
        self._known = known
        self._check = SensorCheck()

    def set_anchors(self, anchors: Array) -> None:
        self._engine.set_anchors(anchors)

    def configure(self, row: int, settings: Array) -> None:
        """Configure the engine. What fails its check from the start leaves nothing of a known start."""
        self._settings = settings
        self._check.start(row, bool(settings["acc_sign_told"]))
        if self._known is not None:
            columns = self._check.columns.copy()
            columns[row] = self._known
            self._check.columns = columns
        self._engine.configure(row, self._without_start() if self._fails else settings)

    def process(self, samples: SampleBatch) -> PoseBatch:
        """Fuse the samples that may be used. A tag whose sensors fail has poses without a position."""
        checked = self._check.check(samples)
        self._note(samples, self._check.unjudged(0))
        made = self._engine.process(checked.samples)
        self._check.mark(made.poses)
        for row in checked.failed.tolist():
            self._engine.configure(row, self._without_start())
        if len(checked.found):
            self._note(samples, self._check.findings(0))
            left_out = np.concatenate(checked.left_out)
            rejected = made.rejected | ({Reason.SENSOR_FAULT: left_out} if len(left_out) else {})
            return replace(made, poses=np.concatenate([made.poses, checked.poses]), rejected=rejected)
        return made

    @property
    def _fails(self) -> bool:
        check = self._check.columns[0]
        return 0 < check["imu_verdict"] < DOUBTS or check["range_verdict"] in (RangeVerdict.IN_MM, RangeVerdict.IN_CM)

    def _without_start(self) -> Array:
        settings = self._settings.copy()
        settings["start_known"] = False
        return settings

    def _note(self, samples: SampleBatch, findings: Sequence[Finding]) -> None:
        t_s = min(int(column["t_ns"][0]) for column in samples.columns() if len(column)) / NS_PER_S
        for finding in findings:
            since_s = self.found.get(finding.name, (t_s, finding))[0]
            self.found[finding.name] = since_s, finding


def known_from_start(samples: Samples, sign_told: bool) -> Array | None:
    """Return CHECK (0-d) with what shows in the first minute: nothing changed before, so it holds from the start."""
    check = SensorCheck()
    check.start(0, sign_told)
    begin_ns = round(samples.start_s * NS_PER_S)
    for batch in in_steps(samples.batch):
        if any(len(column) and column["t_ns"][0] > begin_ns + EARLY_S * NS_PER_S for column in batch.columns()):
            break
        check.check(batch)
    seen, known = check.columns[0], np.zeros((), CHECK)
    known["sign_known"] = sign_told
    if seen["imu_verdict"] < DOUBTS:
        for name in ("imu_verdict", "imu_detail", "known_s", "norm", "level"):
            known[name] = seen[name]
    known["range_verdict"], known["range_detail"] = seen["range_verdict"], seen["range_detail"]
    _add_absurd(known, samples)
    return known if known["imu_verdict"] or known["range_verdict"] else None


def _add_absurd(known: Array, samples: Samples) -> None:
    """Add the verdict on samples of which most were screened out."""
    imu, ranges = samples.rejected[Reason.IMU_ABSURD], samples.rejected[Reason.RANGE_ABSURD]
    if imu > MOSTLY * (imu + len(samples.batch.imu)):
        known["imu_verdict"], known["imu_detail"] = ImuVerdict.RAW_COUNTS, np.nan
    if ranges > MOSTLY * (ranges + len(samples.batch.ranges)):
        known["range_verdict"] = RangeVerdict.IN_MM
