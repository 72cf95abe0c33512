"""The engine without the compiler: the same estimates, so that one may step through its kernels."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from dropanchor_evaluation.product.rows import selected, simulated_rows
from dropanchor_evaluation.product.runs import TagRun, sources, tag_run
from dropanchor_evaluation.product.work import run_tags
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.engine import FleetEngine
from support.fleet_runs import cut

ROWS = ("S5/9-axis/nothing/unknown", "forklift/scalar/nothing/known", "walk-hand/6-axis/nothing/known")
LAST_NS = 8_000_000_000
EXACT = 1e-6  # of a value, and absolute: compiled code fuses multiplications with additions, which rounds differently


def tag_of(name: str) -> TagRun:
    """Return the first seconds of a tag of a row."""
    (row,) = selected(simulated_rows(), [name])
    run = tag_run(row, sources(row, range(5000, 5001))[0])
    return replace(run, samples=cut(run.samples, 0, LAST_NS))


def poses() -> Array:
    """Return the poses of one tag of each row, in one engine."""
    tracks, _ = run_tags(FleetEngine(), [tag_of(name) for name in ROWS])
    return np.concatenate([track.poses for track in tracks])


def test_plain_python_estimates_what_compiled_code_does(tmp_path: Path) -> None:
    file = tmp_path / "plain.npy"
    program = f"import numpy; from {__name__} import poses; numpy.save({str(file)!r}, poses())"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True)
    plain, compiled = np.load(file), poses()
    assert len(plain) == len(compiled) > 200
    assert np.isfinite(plain["x"]).any()
    for name in plain.dtype.names:
        np.testing.assert_allclose(plain[name], compiled[name], rtol=EXACT, atol=EXACT, err_msg=name)
