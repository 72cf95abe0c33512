"""Samples of one tag, each kind in one line, and an engine with that tag."""

import math

import numpy as np

from dropanchor_service.estimation.columns import (
    ANCHOR,
    HEADING,
    IMU,
    RANGE,
    Array,
    SampleBatch,
    State,
    StateReason,
    default_settings,
)
from dropanchor_service.estimation.paper.engine import PaperEngine
from dropanchor_service.estimation.paper.parameters import TUNED
from service.estimation.paper.legs import T0_NS


def engine(row_settings: Array | None = None) -> PaperEngine:
    """Return an engine with one anchor at the origin and row 0, which starts at (10, 0)."""
    made = PaperEngine(TUNED)
    made.set_anchors(np.zeros(1, ANCHOR))
    made.configure(0, start() if row_settings is None else row_settings)
    return made


def start(**changes: object) -> Array:
    settings = default_settings()
    for name, value in {"start_known": True, "start_x": 10.0, "start_y": 0.0, "start_std": 0.1, **changes}.items():
        settings[name] = value
    return settings


def ranges(*pairs: tuple[float, float], anchor: int = 0, row: int = 0) -> SampleBatch:
    """Return RANGE of pairs (time, s, range, m)."""
    return SampleBatch(ranges=np.array([(row, at(t), anchor, r, math.nan) for t, r in pairs], RANGE))


def headings(*pairs: tuple[float, float], row: int = 0) -> SampleBatch:
    """Return HEADING of pairs (time, s, heading, rad)."""
    return SampleBatch(headings=np.array([(row, at(t), h, math.nan) for t, h in pairs], HEADING))


def imu(*times: float, mag: tuple[float, float, float] = (math.nan,) * 3) -> SampleBatch:
    """Return IMU of a level body at rest."""
    return SampleBatch(imu=np.array([(0, at(t), (0, 0, 9.80665), (0, 0, 0), mag) for t in times], IMU))


def at(t: float) -> int:
    return T0_NS + round(t * 1e9)


def state_of(poses: Array) -> tuple[State, StateReason]:
    return State(poses["state"][-1]), StateReason(poses["reason"][-1])
