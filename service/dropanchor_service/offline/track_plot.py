"""A picture of a track against the truth."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dropanchor_service.estimation.columns import Array, Frame, State
from dropanchor_service.offline.accuracy import Truth, truth_at

COLOURS = {
    State.INITIALISING: "0.6",
    State.AMBIGUOUS: "tab:purple",
    State.TRACKING: "tab:blue",
    State.COASTING: "tab:orange",
    State.DEGRADED: "tab:red",
    State.LOST: "0.3",
}


def plot_track(path: Path, title: str, t: Array, poses: Array, truth: Truth | None, anchors: Array) -> None:
    """Write a PNG: the plane on the left, error and 2σ over time on the right.

    t: (n,) s; poses: POSE (n,); anchors: ANCHOR. Raises OSError when the file cannot be written.
    """
    figure = Figure(figsize=(12, 5.5), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    plane, error, speed = figure.subplot_mosaic([["plane", "error"], ["plane", "speed"]]).values()
    if truth is not None:
        plane.plot(truth.x, truth.y, color="0.7", linewidth=3, label="truth")
    for state in State:
        of_state = poses["state"] == state
        if np.isfinite(poses["x"][of_state]).any():
            plane.plot(
                poses["x"][of_state], poses["y"][of_state], ".", ms=2, color=COLOURS[state], label=state.name.lower()
            )
    plane.plot(anchors["x"], anchors["y"], "k^", label="anchor")
    plane.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    plane.legend(loc="best", fontsize="small")
    if truth is not None:
        true_x, true_y = truth_at(truth, t)
        in_site = poses["frame"] == Frame.SITE
        errors = np.where(in_site, np.hypot(poses["x"] - true_x, poses["y"] - true_y), np.nan)
        error.plot(t, errors, linewidth=1, label="error")
    error.plot(t, 2 * poses["sigma_pos"], linewidth=1, color="tab:orange", label="2 σ")
    error.set(ylabel="m", ylim=(0, None))
    error.legend(loc="best", fontsize="small")
    speed.plot(t, poses["speed"], linewidth=1, label="speed")
    speed.set(xlabel="t, s", ylabel="m/s")
    figure.savefig(path, dpi=120, format="png")
