"""What the service sets in the program of a tag, and how an IMU is slowed down."""

import json
import logging
from typing import Any, NamedTuple

from dropanchor_schemas.kinds import ImuSample, Vector
from dropanchor_schemas.remote import MAX_BATCH_S, MAX_IMU_HZ, MIN_BATCH_S, MIN_IMU_HZ

_log = logging.getLogger(__name__)


class RemoteSettings(NamedTuple):
    """batch_s: how long samples wait for others. imu_hz: IMU samples per second at most. None: as the program says."""

    batch_s: float | None = None
    imu_hz: float | None = None

    @property
    def in_words(self) -> str:
        """The settings for people."""
        batch = "as the program says" if self.batch_s is None else f"{self.batch_s:g} s"
        imu = "as the IMU gives them" if self.imu_hz is None else f"at most {self.imu_hz:g} per second"
        return f"batches: {batch}, IMU samples: {imu}"


def parse(payload: bytes) -> RemoteSettings | None:
    """Return the settings in a message of the service; None, with a line in the log, if there are none."""
    try:
        given = json.loads(payload)
        return RemoteSettings(
            _within(given.get("batch_s"), MIN_BATCH_S, MAX_BATCH_S),
            _within(given.get("imu_hz"), MIN_IMU_HZ, MAX_IMU_HZ),
        )
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        _log.warning("settings from the service cannot be used: %s", error)
        return None


def _within(value: Any, low: float, high: float) -> float | None:
    if value is None:
        return None
    if not low <= value <= high:
        raise ValueError(f"{value} is not between {low:g} and {high:g}")
    return float(value)


class Decimator:
    """Reduce IMU samples to `hz` by means, which keep the integrals of rate and acceleration."""

    def __init__(self, hz: float) -> None:
        self._hz = hz
        self._slot = -1
        self._samples: list[ImuSample] = []

    def add(self, sample: ImuSample) -> ImuSample | None:
        """Take a sample. Return the mean of those before it once it begins the next period, else None."""
        slot = int(sample.t_ns * self._hz // 1_000_000_000)
        ready = self._samples if slot != self._slot else []
        if slot != self._slot:
            self._slot, self._samples = slot, []
        self._samples.append(sample)
        return _mean(ready) if ready else None


def _mean(samples: list[ImuSample]) -> ImuSample:
    """Return the mean sample, at the mean time. It has a magnetic field if one of them has."""
    t_ns = sum(sample.t_ns for sample in samples) // len(samples)
    fields = [sample.mag for sample in samples if sample.mag is not None]
    return ImuSample(
        t_ns,
        _mean_vector([sample.acc for sample in samples]),
        _mean_vector([sample.gyro for sample in samples]),
        _mean_vector(fields) if fields else None,
    )


def _mean_vector(vectors: list[Vector]) -> Vector:
    x, y, z = (sum(component) / len(vectors) for component in zip(*vectors, strict=True))
    return x, y, z
