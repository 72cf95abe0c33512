"""Where the recordings with ground truth are, and a small recording of our own."""

import math
import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def recording_or_skip(name: str) -> Path:
    """The folder of a recording; the test is skipped, with the reason printed, where it is missing."""
    folder = Path(os.environ.get("DROPANCHOR_DATA", ROOT / ".." / "shared" / "data")) / name
    if not folder.is_dir():
        pytest.skip(f"the recording {name} is not here; put it there or set DROPANCHOR_DATA")
    return folder


def write_square(folder: Path, range_std_m: float = 0.0) -> Path:
    """A tag drives 1 m/s round a square beside anchor A at (2, -3): 10 Hz ranges, 20 Hz headings, the truth."""
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
