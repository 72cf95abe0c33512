"""What the same messages cost without I/O, in CPU-seconds per million samples: the bare engines, and a simple loop
with one filterpy EKF per tag."""

import time
from typing import Any

import numpy as np

from benchmarks.motion import MESSAGE_S, SAMPLES_PER_MESSAGE, STEP_NS, Track, message, tracks
from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, decode_packed
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.estimation.columns import ANCHOR, IMU, RANGE, SampleBatch
from dropanchor_service.ingest.decode import decode
from dropanchor_service.settings.engine_columns import tag_columns
from dropanchor_service.settings.sources import load_settings

T0_NS = 1_800_000_000_000_000_000
WARM_UP = 15  # messages of each tag before the measurement


def engine_cost(name: str, tags: int, messages: int) -> float:
    """Return the cost of `process` alone, with columns that are already decoded."""
    engine = create_engine(load_settings(options={"engine": name}, environment={}))
    motions = tracks((WARM_UP + messages + 1) * MESSAGE_S)
    engine.set_anchors(np.zeros(1, ANCHOR))
    for row in range(tags):
        x, y, heading = motions[row % len(motions)].start
        start = TagSettings(start=StartPose(x=x, y=y, heading_rad=heading))
        engine.configure(row, tag_columns(start, 0.0))
    spent_s = 0.0
    for sequence in range(WARM_UP + messages):
        batch = columns_of(motions, tags, sequence)
        started_s = time.process_time()
        engine.process(batch)
        spent_s += (time.process_time() - started_s) * (sequence >= WARM_UP)
    return spent_s / (tags * messages * SAMPLES_PER_MESSAGE * 1e-6)


def filterpy_cost(tags: int, messages: int) -> float:
    """Return the cost of a loop that decodes each message and makes one prediction and one update per range."""
    motions = tracks((messages + 1) * MESSAGE_S)
    filters = [_ekf(motions[tag % len(motions)]) for tag in range(tags)]
    payloads = [[_payload(motions, tag, sequence) for tag in range(tags)] for sequence in range(messages)]
    started_s = time.process_time()
    for round_payloads in payloads:
        for ekf, payload in zip(filters, round_payloads, strict=True):
            frame = decode_packed(payload)
            assert isinstance(frame, Frame)
            _fuse(ekf, frame)
    return (time.process_time() - started_s) / (tags * messages * SAMPLES_PER_MESSAGE * 1e-6)


def _payload(motions: list[Track], tag: int, sequence: int) -> bytes:
    return message(motions[tag % len(motions)].bodies[sequence], sequence, tag + 1, T0_NS + sequence * STEP_NS)


def columns_of(motions: list[Track], tags: int, sequence: int) -> SampleBatch:
    """Return message `sequence` of every tag as columns."""
    decoded = decode([_payload(motions, tag, sequence) for tag in range(tags)], [ENCODING_PACKED] * tags)
    ranges = np.zeros(len(decoded.ranges), RANGE)
    ranges["row"], ranges["t_ns"] = decoded.ranges["message"], decoded.ranges["t_ns"]
    ranges["range"], ranges["std"] = decoded.ranges["value"], decoded.ranges["std"]
    imu = np.zeros(len(decoded.imu), IMU)
    imu["row"] = decoded.imu["message"]
    for name in ("t_ns", "acc", "gyro", "mag"):
        imu[name] = decoded.imu[name]
    return SampleBatch(imu=imu, ranges=ranges)


def _ekf(track: Track) -> Any:
    """Return a filter with the state (x, y, heading, speed)."""
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(dim_x=4, dim_z=1)
    ekf.x = np.array([[track.start[0]], [track.start[1]], [track.start[2]], [0.0]])
    ekf.P, ekf.Q, ekf.R = np.diag([0.25, 0.25, 0.1, 1.0]), np.diag([1e-4, 1e-4, 1e-4, 1e-2]), np.array([[0.01]])
    return ekf


def _fuse(ekf: Any, frame: Frame) -> None:
    """Fuse a message, with one prediction per range from the mean yaw rate and acceleration of the IMU samples."""
    half = len(frame.imu) // len(frame.ranges)
    for index, sample in enumerate(frame.ranges):
        inertial = frame.imu[index * half : (index + 1) * half]
        turn = sum(s.gyro[2] for s in inertial) / half
        forward = sum(s.acc[0] for s in inertial) / half
        x, y, heading, speed = ekf.x[:, 0].tolist()
        dt, c, s = 0.1, np.cos(heading), np.sin(heading)
        ekf.F = np.array([[1, 0, -speed * s * dt, c * dt], [0, 1, speed * c * dt, s * dt], [0, 0, 1, 0], [0, 0, 0, 1]])
        ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
        moved = [x + speed * c * dt, y + speed * s * dt, heading + turn * dt, speed + forward * dt]
        ekf.x = np.array(moved)[:, None]
        ekf.update(np.array([[sample.range_m]]), _jacobian, _distance)


def _distance(x: Any) -> Any:
    return np.array([[np.hypot(x[0, 0], x[1, 0])]])


def _jacobian(x: Any) -> Any:
    distance = max(float(np.hypot(x[0, 0], x[1, 0])), 1e-6)
    return np.array([[x[0, 0] / distance, x[1, 0] / distance, 0.0, 0.0]])
