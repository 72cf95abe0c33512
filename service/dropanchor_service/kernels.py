"""Compiled kernels: where they are kept, and compiling them before they are needed.

numba judges its cache by the file of the outermost kernel alone: after an update of a file which that kernel calls
into, it would go on running the old code. So the cache's folder is named after all the sources.
"""

import hashlib
import logging
import os
import tempfile
import time
from pathlib import Path

import numpy as np

from dropanchor_service.estimation.batch import ANCHOR, HEADING, IMU, RANGE, Engine, SampleBatch, default_settings

VARIABLE = "NUMBA_CACHE_DIR"
SLOW_S = 2.0

_log = logging.getLogger(__name__)


def sources_digest() -> str:
    """Of all that the kernels, and the meaning of their rows, are made of."""
    sources = sorted((Path(__file__).parent / "estimation").rglob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]


def keep_compiled() -> None:
    """Choose the cache's folder, unless the environment has. It takes effect if numba is not imported yet."""
    if VARIABLE in os.environ:
        return
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = home / "dropanchor" / f"kernels-{sources_digest()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        writable = os.access(folder, os.W_OK)
    except OSError:
        writable = False
    if not writable:
        # Only a folder that nobody else can have filled: what is read from a cache is run.
        folder = Path(tempfile.mkdtemp(prefix="dropanchor-kernels-"))
        _log.warning("%s is not writable: the estimator is compiled at every start; set %s", home, VARIABLE)
    os.environ[VARIABLE] = str(folder)


def warm_up(engine: Engine) -> None:
    """Compile what `engine`, which is thrown away, runs: a second of a tag that moves off, seen by every sensor."""
    _log.info("loading the compiled estimator; the first time after an update it is compiled, in about a minute")
    started = time.monotonic()
    engine.set_anchors(np.zeros(1, ANCHOR))
    unknown, known = default_settings(), default_settings()
    known["start_known"], known["start_x"], known["start_y"], known["start_heading"] = True, 10.0, 0.0, 0.0
    for row, settings in enumerate((unknown, known)):
        engine.configure(row, settings)
    engine.process(_moving_off(2))
    elapsed = time.monotonic() - started
    if elapsed > SLOW_S:
        _log.info("compiled the estimator in %.0f s; it is kept in %s", elapsed, os.environ.get(VARIABLE, "its cache"))


def _moving_off(rows: int) -> SampleBatch:
    n = 200
    row = np.repeat(np.arange(rows), n)
    t_ns = np.tile(np.arange(n) * 10_000_000, rows)
    imu, ranges, headings = np.zeros(rows * n, IMU), np.zeros(rows * n // 10, RANGE), np.zeros(rows * n // 10, HEADING)
    imu["row"], imu["t_ns"], imu["acc"], imu["mag"] = row, t_ns, (0.3, 0.0, 9.81), (0.0, 20.0, -40.0)
    for columns in (ranges, headings):
        columns["row"], columns["t_ns"], columns["std"] = row[::10], t_ns[::10], np.nan
    ranges["range"] = 10.0 + 0.15 * (t_ns[::10] * 1e-9) ** 2
    return SampleBatch(imu=imu, ranges=ranges, headings=headings)
