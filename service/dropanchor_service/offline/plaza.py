"""The Plaza sets (Djugash, Hamner and Roth, "Navigating with Ranging Radios", J. Field Robotics 26(9), 2009).

An autonomous vehicle with real UWB ranges to four radios, RTK truth and dead reckoning. PyPI's `gtsam` ships them as
MATLAB files: GT (t, x, y, heading), TD (t, sender, receiver, range), DR (t, way, turn), TL (id, x, y).
"""

import importlib.util
import math
import shlex
import sys
from array import array
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from dropanchor_service.estimation.columns import Array
from dropanchor_tag_client.recording import Anchor, Recording, RecordingError

FILES = {"plaza1": ("Plaza1_.mat", 0.0), "plaza2": ("Plaza2_.mat", math.pi)}
"""The file of each set, and the angle from its heading to the direction of travel, rad."""

PLAZA_SCALE, PLAZA_STD = 1.069, 0.6
"""Measured over true distance and standard deviation, m, of the radios, fitted to the truth."""

MISSING = f"the Plaza sets come with gtsam, which is not installed: {shlex.quote(sys.executable)} -m pip install gtsam"


def read_plaza(name: str, folder: Path | None = None) -> Recording:
    """Return plaza1 or plaza2 from the installed gtsam or from a folder with its files. Raises RecordingError.

    Ranges stay as measured (7 % too long). The heading starts with the first true one and then follows the turns of the
    dead reckoning, with the drift of its gyro.
    """
    if name not in FILES:
        raise RecordingError(f"there is no Plaza recording {name!r}; there are {', '.join(FILES)}")
    file, turned = FILES[name]
    path = (folder or _data_of_gtsam()) / file
    try:
        tables = loadmat(path)
        truth, ranges, reckoning, radios = (np.asarray(tables[key], float) for key in ("GT", "TD", "DR", "TL"))
    except (OSError, KeyError, ValueError, MatReadError) as error:
        raise RecordingError(f"{path} cannot be read as a Plaza recording: {error}") from error
    return _recording(name, truth, ranges[np.argsort(ranges[:, 0], kind="stable")], reckoning, radios, turned)


def _data_of_gtsam() -> Path:
    """Return the data folder of gtsam without importing it, because the import is slow."""
    spec = importlib.util.find_spec("gtsam")
    if spec is None or not spec.submodule_search_locations:
        raise RecordingError(MISSING)
    return Path(spec.submodule_search_locations[0]) / "Data"


def _recording(name: str, truth: Array, ranges: Array, reckoning: Array, radios: Array, turned: float) -> Recording:
    start = truth[0, 0]
    yaw = truth[:, 3] + turned
    heading = yaw[0] + np.concatenate([[0.0], np.cumsum(reckoning[:, 2])])
    heading_t = np.concatenate([[start], reckoning[:, 0]]) - start
    return Recording(
        name=name,
        anchors=tuple(Anchor(str(int(i)), float(x), float(y), 0.0) for i, x, y in radios[np.argsort(radios[:, 0])]),
        range_anchors=tuple(str(int(i)) for i in ranges[:, 2]),
        ranges=_columns(t_s=ranges[:, 0] - start, range_m=ranges[:, 3], std_m=np.full(len(ranges), np.nan)),
        imu=_columns(**dict.fromkeys(("t_s", "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz"), np.empty(0))),
        headings=_columns(t_s=heading_t, yaw_rad=_wrapped(heading), std_rad=np.full(len(heading), np.nan)),
        truth=_columns(
            t_s=truth[:, 0] - start, x=truth[:, 1], y=truth[:, 2], z=np.zeros(len(truth)), yaw_rad=_wrapped(yaw)
        ),
    )


def _columns(**columns: Array) -> dict[str, "array[float]"]:
    return {name: array("d", column.tolist()) for name, column in columns.items()}


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + math.pi) % math.tau - math.pi)
