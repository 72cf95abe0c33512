"""Find the recordings with ground truth, and write a small synthetic one."""

import math
import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def recording_or_skip(name: str) -> Path:
    """Return the folder of a recording with ground truth. Skip the test where it is missing.

    The recordings lie in the folder DROPANCHOR_DATA, or in `../shared/data` beside the checkout.
    """
    folder = Path(os.environ.get("DROPANCHOR_DATA", ROOT / ".." / "shared" / "data")) / name
    if not folder.is_dir():
        pytest.skip(
            f"{folder} does not exist: put the recording {name} there, or set DROPANCHOR_DATA to the folder that has it"
        )
    return folder


def write_square(folder: Path, range_std_m: float = 0.0) -> Path:
    """Write the recording of a tag that drives round a square beside anchor A at (2, -3), and return its folder.

    It lasts 60 s and has 10 Hz ranges, 20 Hz headings and the ground truth; the speed is 1 m/s.
    range_std_m: noise of the ranges.
    """
    ranges, headings, truth = ["t_s,anchor_id,range_m"], ["t_s,yaw_rad"], ["t_s,x,y,z,yaw_rad"]
    x, y, yaw = 10.0, 0.0, math.pi / 2
    for step in range(1200):
        t = step * 0.05
        yaw = math.pi / 2 * (1 + step // 200)
        if step % 2 == 0:
            wobble = range_std_m * math.sin(997.0 * step) * math.sqrt(2)
            ranges.append(f"{t:.3f},A,{math.hypot(x - 2, y + 3) + wobble:.4f}")
        headings.append(f"{t:.3f},{yaw:.6f}")
        truth.append(f"{t:.3f},{x:.4f},{y:.4f},0,{yaw:.6f}")
        x, y = x + 0.05 * math.cos(yaw), y + 0.05 * math.sin(yaw)
    tables = {"range": ranges, "heading": headings, "truth": truth, "anchors": ["id,x,y,z", "A,2,-3,0", "B,0,0,0"]}
    for name, lines in tables.items():
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder
