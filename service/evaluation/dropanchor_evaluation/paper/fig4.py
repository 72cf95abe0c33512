"""Fig. 4: speed from noisy ranges on (10, 0) → (10, 250) at 10 m/s: direct, variable window, least squares."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from dropanchor_evaluation.report import Section, Table
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_service.estimation.paper.range_filter import RangeFilter
from dropanchor_service.estimation.paper.speed import SpeedEstimator
from dropanchor_tag_client.simulator.scenarios import trajectory

SPEED = 10.0
SIGMA_M = 0.2
RANGES_M = (50.0, 100.0, 200.0)
FIRST_SEED = 400

RELEASED = PaperParameters()
PAPER_TEXT = replace(RELEASED, pair_spacing=1, window_base=0.0, window_ratio=1.0)
WIDE = replace(RELEASED, th_distance=10.0, pair_spacing=1, window_base=0.0, window_ratio=2.0)

Estimator = Callable[[Array, Array], Array]
"""Times and noisy ranges (n,) → the latest estimate at each time (n,), m/s; NaN before the first."""


def direct(lag: int, rectify: bool) -> Estimator:
    """Return the three-point estimator of ranges `lag` samples apart.

    rectify: use √|v²|, as the released code does; otherwise there is no estimate if v² < 0.
    """

    def estimate(t: Array, r: Array) -> Array:
        dt = (t[-1] - t[0]) / (len(t) - 1)
        v2 = (r[2 * lag :] ** 2 + r[: -2 * lag] ** 2 - 2 * r[lag:-lag] ** 2) / (2 * (lag * dt) ** 2)
        with np.errstate(invalid="ignore"):
            v = np.sqrt(np.abs(v2) if rectify else v2)
        return np.concatenate([np.full(2 * lag, np.nan), v])

    return estimate


def least_squares(window: int) -> Estimator:
    """Return the estimator whose v² is the leading coefficient of a parabola fitted to the last `window` r²(t)."""

    def estimate(t: Array, r: Array) -> Array:
        tau = t[:window] - t[:window].mean()
        basis = tau**2 - (tau**2).mean()
        weights = basis / (basis @ basis)  # orthogonal to 1 and, by symmetry, to tau
        v2 = np.convolve(r**2, weights[::-1], mode="valid")
        return np.concatenate([np.full(window - 1, np.nan), np.sqrt(np.maximum(v2, 0.0))])

    return estimate


def windowed(parameters: PaperParameters) -> Estimator:
    """Return lines 13 to 18 of Algorithm 1: range filter, key range pairs, three-point speed, mean over the window."""

    def estimate(t: Array, r: Array) -> Array:
        p = parameters
        smooth = RangeFilter(float(r[0]), p.q_smooth, p.r_smooth)
        speed = SpeedEstimator(p.th_distance, p.pair_spacing, p.window_base, p.window_ratio)
        dt = float(t[1] - t[0])
        standing, out = np.nan, np.empty(len(t))
        for i, (time, z) in enumerate(zip(t.tolist(), r.tolist(), strict=True)):
            new = speed.step(time, smooth.step(dt, z))
            standing = standing if new is None else new
            out[i] = standing
        return out

    return estimate


ESTIMATORS: dict[str, Estimator] = {
    "three points, Δt 0.01 s, rectified": direct(1, rectify=True),
    "three points, Δt 0.5 s": direct(50, rectify=False),
    "three points, Δt 2 s": direct(200, rectify=False),
    "Algorithm 1, released parameters": windowed(RELEASED),
    "Algorithm 1, consecutive pairs, window 1·r (paper's text)": windowed(PAPER_TEXT),
    "Algorithm 1, pairs 10 m apart, window 2·r": windowed(WIDE),
    "least squares, 2 s": least_squares(201),
    "least squares, 4 s": least_squares(401),
}


@dataclass(frozen=True)
class At:
    """Speed error at one range over all seeds, m/s. missing: share of the seeds without an estimate."""

    mean: float
    std: float
    missing: float


def run(seeds: int = 40) -> Section:
    motion = trajectory("fig4", 0)
    distance = motion.distance
    noisy = [distance + np.random.default_rng(FIRST_SEED + s).normal(0, SIGMA_M, len(distance)) for s in range(seeds)]
    estimates = {name: np.array([e(motion.t, r) for r in noisy]) for name, e in ESTIMATORS.items()}
    rows = {name: [_at(e, int(np.argmin(np.abs(distance - r)))) for r in RANGES_M] for name, e in estimates.items()}
    wide = rows["Algorithm 1, pairs 10 m apart, window 2·r"]
    released = rows["Algorithm 1, released parameters"]
    return Section(
        key="fig4",
        title="Fig. 4: speed against range, σ = 0.2 m",
        paper="The deviation of the direct speed grows with range; the variable window gives the correct speed.",
        finding=f"With the released parameters the window is off by {released[0].mean:+.1f} m/s at 50 m and "
        f"{released[2].mean:+.1f} m/s at 200 m; only with key pairs some 10 m apart is it right (within "
        f"{max(abs(at.mean) + at.std for at in wide):.2f} m/s). A least-squares window needs no such choice.",
        text=[
            "The threshold decides: pairs closer than the noise select noise, and the root rectifies it. The figure "
            "of the paper can be had with 0.005 m of noise (that of the released data) or with wide spacing.",
            f"Seeds {FIRST_SEED} to {FIRST_SEED + seeds - 1}; errors are taken where the true range is 50, 100, 200 m.",
        ],
        tables=[
            Table(
                "Mean error / standard deviation of the speed, m/s (true: 10 m/s)",
                ["estimator", *(f"{r:.0f} m" for r in RANGES_M)],
                [[name, *(f"{at.mean:+.2f} / {at.std:.2f}" for at in row)] for name, row in rows.items()],
            )
        ],
        figures={"fig4": _figure(distance, estimates)},
        results={
            name: {f"{r:.0f}": asdict(at) for r, at in zip(RANGES_M, row, strict=True)} for name, row in rows.items()
        },
    )


def _at(estimates: Array, index: int) -> At:
    errors = estimates[:, index] - SPEED
    known = errors[np.isfinite(errors)]
    if len(known) == 0:
        return At(np.nan, np.nan, 1.0)
    return At(float(known.mean()), float(known.std()), 1.0 - len(known) / len(errors))


def _figure(distance: Array, estimates: dict[str, Array]) -> Figure:
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    axes = figure.subplots()
    names = list(estimates)
    for name, style in ((names[1], "-"), (names[3], "-"), (names[5], "-"), (names[6], "-")):
        axes.plot(distance, estimates[name][0], style, linewidth=0.9, label=name)
    axes.axhline(SPEED, color="0.5", linewidth=2, zorder=0)
    axes.set(xlabel="range, m", ylabel="m/s", ylim=(0, 45), title="one seed")
    axes.legend(loc="upper left", fontsize="small")
    return figure
