"""The bends that a tag drives tell how it is mounted, and when it was turned."""

import math

import numpy as np
import pytest

from dropanchor_service.blackbox.mounting import turned
from dropanchor_tag_client.simulator.live import simulation
from support.scripted_past import MODELS

SEED, SECONDS, TURNED_S = 31, 90.0, 45.0


@pytest.mark.parametrize(
    ("turn", "told", "before", "after"),
    [
        (math.pi / 2, None, 0.0, -math.pi / 2),
        (-math.pi / 2, 0.0, 0.0, math.pi / 2),
        (math.pi / 2, 1.0, None, None),
        (0.0, 0.0, None, None),
        (math.pi, None, None, None),
    ],
    ids=["left", "right", "not as told before", "as told", "half a turn, which may be driving backwards"],
)
def test_bends_tell_how_a_tag_is_mounted(
    turn: float, told: float | None, before: float | None, after: float | None
) -> None:
    for index in range(3):
        imu = simulation("yard", SEED, index, MODELS, SECONDS).imu
        angle = np.where(imu.t_s < TURNED_S, 0.0, turn)
        acc, gyro = (_about_up(column, angle) for column in (imu.acc, imu.gyro))
        found = turned(np.round(imu.t_s * 1e9).astype(np.int64), acc, gyro, told)
        if before is None or after is None:
            assert found is None
            continue
        assert found is not None
        for angle_then, expected in ((found.before, before), (found.after, after)):
            assert abs(math.remainder(angle_then - expected, math.tau)) < 0.4


def test_a_tag_that_sent_hardly_anything_tells_nothing() -> None:
    for count in range(3):
        assert turned(np.arange(count), np.ones((count, 3)), np.zeros((count, 3)), 0.0) is None


def _about_up(vectors: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return what a body measures that has turned left by these angles."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = vectors.T
    return np.stack([c * x + s * y, -s * x + c * y, z], axis=1)
