"""The engines give what is written down, on samples that are written down.

TOLERANCE is not zero because another processor may fuse a multiplication and an addition that this one does not; such
differences are of the order of 1e-12. A change of the estimators that matters to anyone is larger than 1e-6 m.
"""

import numpy as np
import pytest

from replay.outputs import COLUMNS, REPLAYS, read_expected, replay

TOLERANCE = 1e-6  # absolute, in m, rad and their squares; and relative, for variances of thousands of m²
REWRITE = "PYTHONPATH=tests .venv/bin/python -m replay.rewrite"


@pytest.mark.parametrize(("name", "engine"), REPLAYS)
def test_a_replay_gives_the_poses_that_are_written_down(name: str, engine: str) -> None:
    expected, given = read_expected(name, engine), replay(name, engine)
    assert len(given) == len(expected)
    for column, was, now in zip(COLUMNS, zip(*expected, strict=True), zip(*given, strict=True), strict=True):
        message = f"{column} of {name} with the engine {engine}: if that is meant, run `{REWRITE}`"
        np.testing.assert_allclose(now, was, rtol=TOLERANCE, atol=TOLERANCE, err_msg=message)
