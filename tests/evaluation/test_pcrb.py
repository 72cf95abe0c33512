"""The posterior Cramér-Rao bound."""

import numpy as np

from dropanchor_evaluation.pcrb import Path, Sensors, position_bound

N, DT = 400, 0.05
T = DT * np.arange(N)


def test_knowing_more_never_makes_the_bound_larger() -> None:
    speed = np.where(T < 8, 1.0, 2.5)
    path = Path(T, np.full(N, 12.0), np.cumsum(speed) * DT - 10, np.full(N, np.pi / 2), speed, np.ones(N, bool))
    known = position_bound(path, Sensors(), "range+heading, jumps known")
    walk = position_bound(path, Sensors(), "range+heading, random-walk speed")
    assert known.mean() < walk.mean()
    every_fourth = Path(path.t, path.x, path.y, path.course, path.v, np.arange(N) % 4 == 0)
    assert position_bound(every_fourth, Sensors(), "with accelerometer").mean() > (
        position_bound(path, Sensors(), "with accelerometer").mean()
    )
