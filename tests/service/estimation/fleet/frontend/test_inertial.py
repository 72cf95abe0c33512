"""The front-end of a row: deterministic, independent of batches, and safe from invalid numbers."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dropanchor_service.estimation.fleet.frontend.node import NODE
from dropanchor_service.estimation.fleet.frontend.state import FRONTEND, start_frontend
from support.frontend import drive, nanoseconds, new_frontend, run
from support.imu import Motion, synthesise, turning

Array = NDArray[Any]


def ride(seconds: float = 20.0) -> Motion:
    rng = np.random.default_rng(5)
    m = synthesise(np.arange(0, seconds, 0.01), turning)
    m.mag = m.mag + np.array([0.3, -0.2, 0.4]) + rng.normal(0, 0.02, m.mag.shape)
    m.gyro += rng.normal(0, 0.01, m.gyro.shape)
    m.acc += rng.normal(0, 0.2, m.acc.shape)
    return m


def finite(rows: Array) -> bool:
    """Return whether every float of the row is finite."""
    return bool(np.isfinite(np.frombuffer(flatten(rows).tobytes())).all())


def flatten(value: Array) -> Array:
    """Return all float64 fields of a structured array, one after the other."""
    if value.dtype.names is None:
        return value.ravel() if value.dtype == np.float64 else np.empty(0)
    return np.concatenate([flatten(value[name]) for name in value.dtype.names])


def test_results_do_not_depend_on_how_samples_are_cut_into_batches() -> None:
    m = ride()
    ends = np.arange(0.083, 19.9, 0.083)
    whole_rows, cut_rows = new_frontend(), new_frontend()
    whole = run(whole_rows, m, ends)
    cut = np.zeros(len(ends), NODE)
    t, stops = nanoseconds(m.t), nanoseconds(ends)
    for low in range(0, len(ends), 7):
        high = min(low + 7, len(ends))
        first = 0 if low == 0 else int(np.searchsorted(t, stops[low - 1], side="right"))
        last = len(t) if high == len(ends) else int(np.searchsorted(t, stops[high - 1], side="right"))
        acc, gyro, mag = (np.ascontiguousarray(c[first:last]) for c in (m.acc, m.gyro, m.mag))
        drive(cut_rows[0], t[first:last], acc, gyro, mag, stops[low:high], cut[low:high])
    assert cut.tobytes() == whole.tobytes()
    assert flatten(cut_rows).tobytes() == flatten(whole_rows).tobytes()


def test_a_row_started_again_forgets_everything() -> None:
    m, ends = ride(), np.arange(0.1, 19.9, 0.1)
    used, fresh = new_frontend(), new_frontend()
    run(used, m, ends)
    start_frontend(used[0], 1.0, 0.0)
    assert run(used, m, ends).tobytes() == run(fresh, m, ends).tobytes()


def test_rows_are_aligned_and_small() -> None:
    assert FRONTEND.itemsize % 8 == 0
    assert FRONTEND.itemsize < 2048


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["acc", "gyro", "mag"])
def test_samples_that_are_not_finite_never_reach_the_state(column: str, bad: float) -> None:
    m = ride()
    getattr(m, column)[np.arange(len(m.t)) % 50 == 3, 1] = bad
    rows = new_frontend()
    nodes = run(rows, m, np.arange(0.1, 19.9, 0.1))
    assert finite(rows)
    assert np.isfinite(nodes["heading"]).all()
    assert np.isfinite(nodes["dyaw"]).all()


def test_zeros_and_huge_values_leave_finite_numbers() -> None:
    m = ride()
    m.acc[300:400] = 0.0
    m.mag[:100] = 0.0
    m.acc[500:510], m.gyro[600:610], m.mag[700:710] = 1e6, 1e3, 1e9
    rows = new_frontend()
    nodes = run(rows, m, np.arange(0.1, 19.9, 0.1))
    assert finite(rows)
    assert np.isfinite(nodes["heading"]).all()


def test_samples_out_of_order_or_twice_are_left_out() -> None:
    m, ends = ride(), np.arange(0.1, 19.9, 0.1)
    twice = m.at(np.repeat(np.arange(len(m.t)), 2))
    a, b = run(new_frontend(), m, ends), run(new_frontend(), twice, ends)
    assert b["heading"] == pytest.approx(a["heading"], abs=1e-9)
