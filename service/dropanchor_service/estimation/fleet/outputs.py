"""The output of the engine: poses, innovations and modes from nodes and beliefs, in compiled code."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import HYPOTHESIS, INNOVATION, POSE, Array, MeasurementKind
from dropanchor_service.estimation.fleet.belief.layout import Anchors, Beliefs, Pool, Rows
from dropanchor_service.estimation.fleet.belief.publish import list_modes
from dropanchor_service.estimation.fleet.belief.states import AMBIGUOUS
from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.frontend.event import PRESSURE_EVENT
from dropanchor_service.estimation.fleet.frontend.height import DOUBTED
from dropanchor_service.estimation.fleet.frontend.inertial import REPEATED, STUCK
from dropanchor_service.estimation.fleet.frontend.node import BEARING, RANGE, Nodes

MODES: Final = 8  # at most, of a pose
REJECTED_ABOVE: Final = 0.5  # outlier probability above which a measurement hardly moved the belief
SKIPPED: Final = {REPEATED: "time_repeated", STUCK: "imu_stuck"}
OF_RANGE, OF_BEARING = int(MeasurementKind.RANGE), int(MeasurementKind.BEARING)


class Part(NamedTuple):
    """The output of some rows: POSE, HYPOTHESIS, INNOVATION, and the rows of stuck ranges under their reason."""

    poses: Array
    modes: Array
    innovations: Array
    stuck: dict[str, Array]


def joined(parts: Sequence[Part]) -> Part:
    """Return the output of all rows."""
    if len(parts) == 1:
        return parts[0]
    poses, modes, innovations = (_concatenated(columns) for columns in list(zip(*parts, strict=True))[:3])
    stuck = [rows for part in parts for rows in part.stuck.values()]
    return Part(poses, modes, innovations, {"range_stuck": np.concatenate(stuck)} if stuck else {})


def _concatenated(columns: Sequence[Array]) -> Array:
    raw = np.dtype((np.void, columns[0].itemsize))  # NumPy copies records field by field
    return np.concatenate([column.view(raw) for column in columns]).view(columns[0].dtype)


def poses_of(nodes: Array, beliefs: Array) -> Array:
    """Return POSE of every node that ended with a range, from its belief."""
    poses = np.zeros(len(nodes), POSE)
    return poses[: _write_poses(nodes, beliefs, poses)]


def innovations_of(nodes: Nodes, beliefs: Beliefs) -> Array:
    """Return INNOVATION of the nodes whose measurement met a belief: z = predicted + innovation, as measured."""
    records = np.zeros(len(nodes), INNOVATION)
    return records[: _write_innovations(nodes, beliefs, records)]


def stuck_ranges_of(nodes: Nodes, beliefs: Beliefs) -> dict[str, Array]:
    """Return the row of each range that a stuck radio repeated, under the reason of its rejection."""
    stuck = beliefs["stuck"]
    return {"range_stuck": nodes["row"][stuck]} if stuck.any() else {}


def skipped_of(imu: Array, verdicts: Array) -> dict[str, Array]:
    """Return the row of each IMU sample that its front-end did not use, under the reason of its rejection."""
    if not verdicts.any():
        return {}
    by_reason = {reason: imu["row"][verdicts == code] for code, reason in SKIPPED.items()}
    return {reason: rows for reason, rows in by_reason.items() if len(rows)}


def doubted_of(events: Array, order: Array, imu: int) -> dict[str, Array]:
    """Return the row of each pressure that is in doubt, under the reason of its rejection. order: as of `Due`."""
    taken = order[order >= imu] - imu
    pressures = taken[events["kind"][taken] == PRESSURE_EVENT]
    if not len(pressures):
        return {}
    doubted = pressures[events["anchor"][pressures] == DOUBTED]
    return {"pressure_doubted": events["row"][doubted]} if len(doubted) else {}


def with_rows(by_kind: dict[str, Array], kind: str, rejected: dict[str, Array]) -> dict[str, Array]:
    """Return `by_kind` with the rows of `rejected`, which are all of one kind."""
    if not rejected:
        return by_kind
    return by_kind | {kind: np.concatenate([*rejected.values(), by_kind.get(kind, np.empty(0, np.int32))])}


def modes_of(nodes: Array, beliefs: Array, rows: Array, pool: Array, anchors: Array, workspace: Array) -> Array:
    """Return HYPOTHESIS: the modes of each row that its last node left ambiguous. A row's nodes are together."""
    last = np.ones(len(nodes), bool)
    last[:-1] = nodes["row"][1:] != nodes["row"][:-1]
    ambiguous = nodes["row"][(beliefs["state"] == AMBIGUOUS) & last]
    modes = np.zeros(MODES * len(ambiguous), HYPOTHESIS)
    return modes[: _write_modes(ambiguous, rows, pool, anchors, workspace, modes)]


@njit(cache=True, nogil=True)
def _write_poses(nodes: Nodes, beliefs: Beliefs, poses: Array) -> int:
    n = 0
    for k in range(len(nodes)):
        node, belief = nodes[k], beliefs[k]
        if node.kind != RANGE:
            continue
        pose = poses[n]
        n += 1
        pose.row, pose.t_ns, pose.anchor, pose.range = node.row, node.t_ns, node.anchor, node.z
        pose.frame = belief.relative
        pose.z, pose.z_std, pose.z_source = belief.z, belief.z_std, node.height_source
        pose.state, pose.reason, pose.yaw_rate = belief.state, belief.reason, belief.yaw_rate
        if belief.hypotheses == 0:
            pose.x = pose.y = pose.heading = pose.speed = pose.p_mode = pose.sigma_pos = pose.sigma_obs = np.nan
            pose.cov[:] = np.nan
            pose.parts[:] = np.nan
            continue
        pose.x, pose.y, pose.heading, pose.speed = belief.x, belief.y, belief.course, belief.speed
        pose.p_mode, pose.sigma_pos, pose.sigma_obs = belief.p_mode, belief.sigma_pos, belief.sigma_obs
        pose.cov[:] = belief.cov
        pose.parts[:] = belief.parts
    return n


@njit(nogil=True)
def _kind_of(measurement: int) -> int:
    """Return the MeasurementKind of a node's measurement."""
    if measurement == RANGE:
        return OF_RANGE
    if measurement == BEARING:
        return OF_BEARING
    raise ValueError("the node's measurement has no MeasurementKind: add it here")


@njit(cache=True, nogil=True)
def _write_innovations(nodes: Nodes, beliefs: Beliefs, records: Array) -> int:
    n = 0
    for k in range(len(nodes)):
        node, belief = nodes[k], beliefs[k]
        if not belief.innovation_variance > 0.0:
            continue
        record = records[n]
        n += 1
        record.row, record.t_ns, record.anchor = node.row, node.t_ns, node.anchor
        record.kind = _kind_of(node.kind)
        record.measured = node.z
        record.innovation = belief.innovation
        record.predicted = node.z - record.innovation
        record.S = belief.innovation_variance
        record.p_outlier = belief.p_outlier
        record.white_std, record.lasting_std = belief.white_std, belief.lasting_std
        record.fused = belief.p_outlier < REJECTED_ABOVE
    return n


@njit(cache=True, nogil=True)
def _write_modes(numbers: Array, rows: Rows, pool: Pool, anchors: Anchors, workspace: Rows, modes: Array) -> int:
    n = 0
    for row in numbers:
        found = list_modes(rows[row], pool, anchors, workspace[0], modes[n : n + MODES])
        for mode in range(n, n + found):
            modes[mode].row = row
        n += found
    return n
