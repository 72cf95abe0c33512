"""A tag that moves across its own axes is noticed, and a vehicle on a rough or winding way is none."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import default_settings
from dropanchor_service.estimation.fleet.belief.layout import ACC_BIAS, GYRO_BIAS, LEFT_BIAS, MOUNT, SLIP, N, V
from dropanchor_service.estimation.fleet.belief.rigidity import follow_sliding, slides
from dropanchor_service.estimation.fleet.configure import configure_row
from dropanchor_service.estimation.fleet.frontend.node import MOVING, RESTING
from dropanchor_service.estimation.fleet.tuning import Tuning
from support.belief import STATE, hypothesis_of, node_of

DT = 0.1  # s
TUNING = Tuning().record()[0]


def row_of(mount_angle: float = math.nan) -> Any:
    settings = default_settings()
    settings["mount_angle"] = mount_angle
    configured = configure_row(settings, Tuning())
    rows = np.zeros(1, configured.dtype)
    rows[0] = configured
    return rows[0]


def move(row: Any, sway: float, turn: float = 0.0, jolts: float = 0.0, speed: float = 1.0, rest: bool = False) -> None:
    """Move for 20 s. sway: amplitude of the velocity to the left, m/s. turn: of the yaw rate, rad/s. jolts: m/s."""
    rng = np.random.default_rng(13)
    state = STATE.copy()
    state[V] = speed
    state[[MOUNT, SLIP, GYRO_BIAS, ACC_BIAS, LEFT_BIAS]] = 0.0
    for k in range(200):
        dyaw = DT * turn * math.sin(0.2 * k)
        left = sway * (math.sin(0.25 * k) - math.sin(0.25 * (k - 1))) + speed * dyaw + rng.normal(0.0, jolts)
        node = node_of(dt=DT, dyaw=dyaw, forward=0.0, left=left)
        node["rest"] = RESTING if rest else MOVING
        one, scratch = hypothesis_of(state, np.diag(np.full(N, 1e-4)))
        follow_sliding(one, scratch, node, row, TUNING)


def test_a_tag_that_sways_slides() -> None:
    row = row_of()
    move(row, sway=1.0)
    assert slides(row)


@pytest.mark.parametrize("turn", [0.0, 0.8])
@pytest.mark.parametrize("jolts", [0.0, 0.01])
def test_a_vehicle_that_winds_and_jolts_does_not(turn: float, jolts: float) -> None:
    row = row_of()
    move(row, sway=0.0, turn=turn, jolts=jolts)
    assert not slides(row)


def test_a_told_mount_says_that_the_tag_moves_along_its_axis() -> None:
    row = row_of(mount_angle=0.0)
    move(row, sway=1.0)
    assert not slides(row)


def test_what_moves_at_rest_tells_nothing() -> None:
    row = row_of()
    move(row, sway=1.0, rest=True)
    assert row["mount"]["sliding"] == 0.0
