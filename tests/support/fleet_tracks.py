"""Seeded synthetic tracks for the pose belief: straight legs and arcs with heading-level sensors at 10 Hz."""

from typing import Any, NamedTuple

import numpy as np

from dropanchor_service.estimation.columns import ANCHOR, default_settings
from dropanchor_service.estimation.fleet.belief.layout import BELIEF, ROW
from dropanchor_service.estimation.fleet.belief.pool import make_pool
from dropanchor_service.estimation.fleet.belief.step import advance
from dropanchor_service.estimation.fleet.belief.workspace import make_workspace
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.frontend.node import MEASURED_HEADING, NODE, RANGE
from dropanchor_service.estimation.fleet.tuning import Tuning

DT = 0.1
CALIBRATED = Tuning(range_bias_std=0.0)


class Drive(NamedTuple):
    nodes: Any  # NODE (n,)
    x: Any
    y: Any
    speed: Any


def drive(seed: int, legs: int = 4, turns: float = 1.0, range_std: float = 0.1, row: int = 0) -> Drive:
    """Return a drive from (10, 0): 1 s of rest, then legs of 8 s at 0.8-3 m/s, with turns of turns * (0.5-2) rad."""
    rng = np.random.default_rng(seed)
    speed, rate = [np.zeros(11)], [np.zeros(11)]
    for leg in range(legs):
        v, w = np.full(80, rng.uniform(0.8, 3.0)), np.zeros(80)
        if leg > 0:
            w[:8] = turns * rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0) / (8 * DT)
        speed.append(v)
        rate.append(w)
    v, w = np.concatenate(speed), np.concatenate(rate)
    v = np.convolve(np.concatenate([np.zeros(4), v]), np.full(5, 0.2), "valid")
    yaw = rng.uniform(-np.pi, np.pi) + np.concatenate([[0.0], np.cumsum(w[:-1]) * DT])
    middle, mean_v = yaw[:-1] + w[:-1] * DT / 2, (v[:-1] + v[1:]) / 2
    x = 10.0 + np.concatenate([[0.0], np.cumsum(mean_v * np.cos(middle)) * DT])
    y = np.concatenate([[0.0], np.cumsum(mean_v * np.sin(middle)) * DT])
    return Drive(sense(rng, x, y, yaw, v, range_std, row), x, y, v)


def sense(rng: Any, x: Any, y: Any, yaw: Any, v: Any, range_std: float, row: int) -> Any:
    """Return NODE (n,) of this motion: noisy yaw increments, accelerations, headings and ranges to the origin."""
    n = len(x)
    nodes = np.zeros(n, NODE)
    nodes["row"], nodes["t_ns"], nodes["dt_s"] = row, (np.arange(n) * DT * 1e9).astype(np.int64), DT
    nodes["dyaw"][1:] = np.diff(yaw) + 0.002 * rng.standard_normal(n - 1)
    nodes["dyaw_var"] = 0.002**2
    turned = np.diff(yaw)  # dv is in the frame at the start of a node, to which a turn adds the centripetal part
    nodes["dv_forward"][1:] = v[1:] * np.cos(turned) - v[:-1] + 0.05 * DT + 0.01 * rng.standard_normal(n - 1)
    nodes["dv_left"][1:] = v[1:] * np.sin(turned)
    nodes["dv_var"] = 0.01**2
    nodes["heading"] = yaw + 0.03 * rng.standard_normal(n)
    nodes["heading_var"], nodes["heading_kind"] = 0.03**2, MEASURED_HEADING
    nodes["kind"], nodes["z"] = RANGE, np.hypot(x, y) + range_std * rng.standard_normal(n)
    nodes["z_std"] = range_std
    nodes["rest"][8:10] = 1
    return nodes


def rows_of(count: int, known: bool) -> Any:
    """Return ROW (count,) of tags with a known mounting, at the start of `drive` or with an unknown start."""
    settings = default_settings()
    settings["mount_angle"], settings["range_std"] = 0.0, 0.1
    if known:
        settings["start_known"], settings["start_x"], settings["start_y"] = True, 10.0, 0.0
    rows = np.zeros(count, ROW)
    rows[:] = configure_row(settings, CALIBRATED)
    return rows


ANCHORS = np.zeros(1, ANCHOR)


def run(rows: Any, pool: Any, nodes: Any) -> Any:
    """Return BELIEF, one per node."""
    beliefs = np.zeros(len(nodes), BELIEF)
    assert advance(rows, pool, nodes, ANCHORS, CALIBRATED.record(), make_workspace(), beliefs) == 0
    return beliefs


def track(drive_: Drive, known: bool) -> Any:
    """Return BELIEF of one drive."""
    return run(rows_of(1, known), make_pool(512), drive_.nodes)
