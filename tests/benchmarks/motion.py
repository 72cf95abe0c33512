"""Packed messages of simulated tags, made in advance: 5 per second, each with 20 IMU samples and 2 ranges."""

from dataclasses import dataclass

import numpy as np

from dropanchor_schemas.wire import HEADER, VERSION
from dropanchor_tag_client.simulator.live import YARD, simulation
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation

MESSAGE_S = 0.2
IMU_PER_MESSAGE, RANGES_PER_MESSAGE = 20, 2
SAMPLES_PER_MESSAGE = IMU_PER_MESSAGE + RANGES_PER_MESSAGE
STEP_NS = int(MESSAGE_S * 1e9)
ANCHOR = 1  # number of the one anchor, as in the settings of the measured service
TRACKS = 48  # distinct motions; tag i moves like track i % TRACKS

_PACKED_IMU = np.dtype([("dt_us", "<u4"), ("values", "<f4", 9)])
_PACKED_RANGE = np.dtype([("dt_us", "<u4"), ("anchor", "<u4"), ("value", "<f4"), ("std", "<f4")])


@dataclass(frozen=True)
class Track:
    """start: x and y in m, heading in rad. bodies: the messages of a tag without their headers."""

    start: tuple[float, float, float]
    bodies: list[bytes]


def tracks(duration_s: float, count: int = TRACKS) -> list[Track]:
    """Return `count` simulated tracks with 10 Hz ranges and 100 Hz raw IMU samples."""
    sensors = preset("calibrated", 10.0, 100.0)
    return [_track(simulation(YARD, 0, index, sensors, duration_s)) for index in range(count)]


def message(body: bytes, sequence: int, boot_id: int, newest_ns: int) -> bytes:
    """Return a payload whose last IMU sample and last range are of `newest_ns`."""
    t0_ns = newest_ns - STEP_NS
    return HEADER.pack(VERSION, 0, IMU_PER_MESSAGE, RANGES_PER_MESSAGE, 0, sequence, boot_id, t0_ns, 0, 0, 0, 0) + body


def _track(run: Simulation) -> Track:
    truth = run.truth
    messages = round(float(run.imu.t_s[-1]) / MESSAGE_S)
    start = (float(truth.x[0]), float(truth.y[0]), float(truth.heading[0]))
    return Track(start, [_body(run, index) for index in range(messages)])


def _body(run: Simulation, index: int) -> bytes:
    """Return the samples of (index, index + 1] · 0.2 s. The newest of both kinds is of the end."""
    imu = np.zeros(IMU_PER_MESSAGE, _PACKED_IMU)
    chosen = slice(index * IMU_PER_MESSAGE + 1, (index + 1) * IMU_PER_MESSAGE + 1)
    imu["dt_us"] = np.arange(1, IMU_PER_MESSAGE + 1) * 10_000
    imu["values"] = np.hstack([run.imu.acc[chosen], run.imu.gyro[chosen], run.imu.mag[chosen]])
    ranges = np.zeros(RANGES_PER_MESSAGE, _PACKED_RANGE)
    chosen = slice(index * RANGES_PER_MESSAGE + 1, (index + 1) * RANGES_PER_MESSAGE + 1)
    ranges["dt_us"] = np.arange(1, RANGES_PER_MESSAGE + 1) * 100_000
    ranges["anchor"] = ANCHOR
    ranges["value"], ranges["std"] = run.ranges.range_m[chosen], run.ranges.std_m[chosen]
    return imu.tobytes() + ranges.tobytes()
