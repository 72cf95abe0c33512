"""Sec. II-C: propagation of range noise to the speed, by the paper's formulas, the corrected ones and a Monte Carlo."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from dropanchor_evaluation.report import Section, Table
from dropanchor_service.estimation.columns import Array

UNEQUAL_TIMES_S = (0.0, 0.4, 1.5)


@dataclass(frozen=True)
class Case:
    """A tag that passes (start, 0) in the y direction, with three ranges at intervals of dt and white noise."""

    start_m: float
    speed_mps: float
    dt_s: float
    sigma_m: float

    def ranges(self) -> Array:
        """Return the three true ranges, m."""
        r: Array = np.hypot(self.start_m, self.speed_mps * self.dt_s * np.arange(3))
        return r

    @property
    def second_difference(self) -> float:
        """S = r0² + r2² − 2·r1² = 2·v²·dt²."""
        r0, r1, r2 = self.ranges()
        return float(r0**2 + r2**2 - 2 * r1**2)


CASES = [
    Case(10.0, 2.0, 1.0, 0.01),
    Case(10.0, 2.0, 1.0, 0.05),
    Case(10.0, 2.0, 2.0, 0.05),
    Case(10.0, 2.0, 1.0, 0.2),
    Case(50.0, 2.0, 5.0, 0.2),
    Case(100.0, 10.0, 2.0, 0.2),
]


def paper_std(case: Case) -> float:
    """Return eq. (4) as printed: (δv)² = (2 + 10·r1²/S)·δr²·Δt²."""
    r1 = case.ranges()[1]
    return float(np.sqrt(2 + 10 * r1**2 / case.second_difference) * case.sigma_m * case.dt_s)


def corrected_std(case: Case) -> float:
    """Return the first-order result (δv)² = (1 + 6·r1²/S)·δr²/(2·Δt²).

    It follows from v = √(S/2)/Δt with ∂v/∂r0 = r0/(2vΔt²) and ∂v/∂r1 = −r1/(vΔt²).
    """
    r1 = case.ranges()[1]
    return float(np.sqrt((1 + 6 * r1**2 / case.second_difference) / 2) * case.sigma_m / case.dt_s)


@dataclass(frozen=True)
class Sampled:
    """Monte Carlo result. std, bias: of v over the draws with S > 0. negative: share of the other draws."""

    std: float
    bias: float
    negative: float


def sampled(case: Case, draws: int, seed: int) -> Sampled:
    rng = np.random.default_rng(seed)
    r = case.ranges() + rng.normal(0.0, case.sigma_m, (draws, 3))
    s = r[:, 0] ** 2 + r[:, 2] ** 2 - 2 * r[:, 1] ** 2
    v = np.sqrt(s[s > 0] / 2) / case.dt_s
    return Sampled(float(v.std()), float(v.mean() - case.speed_mps), float(np.mean(s <= 0)))


def unequal_intervals(times_s: tuple[float, float, float], speed_mps: float, start_m: float) -> tuple[float, float]:
    """Return the paper's and the corrected three-point speed of a noise-free straight line, m/s.

    v² = ((r2² − r1²) − (Δt2/Δt1)(r1² − r0²)) / D, D printed as Δt1·Δt2 + Δt1², derived as Δt1·Δt2 + Δt2²: with
    r_i² = r² + (x + v·t_i)², the numerator is 2xvΔt2 + v²(Δt2² + 2Δt1Δt2) − (Δt2/Δt1)(2xvΔt1 + v²Δt1²).
    """
    t0, t1, t2 = times_s
    r0, r1, r2 = np.hypot(start_m, speed_mps * np.array(times_s))
    dt1, dt2 = t1 - t0, t2 - t1
    numerator = (r2**2 - r1**2) - dt2 / dt1 * (r1**2 - r0**2)
    return float(np.sqrt(numerator / (dt1 * dt2 + dt1**2))), float(np.sqrt(numerator / (dt1 * dt2 + dt2**2)))


def run(draws: int = 400_000, seed: int = 20) -> Section:
    rows = [(case, sampled(case, draws, seed)) for case in CASES]
    printed, corrected = unequal_intervals(UNEQUAL_TIMES_S, 2.0, 10.0)
    return Section(
        key="error_propagation",
        title="Error propagation of the three-point speed (Sec. II-C)",
        paper="(δv)² = (2 + 10·r1²/(r2² + r0² − 2·r1²))·δr²·Δt²: longer intervals give larger errors.",
        finding="The printed formula is wrong; the Monte Carlo agrees with (δv)² = (1 + 6·r1²/S)·δr²/(2·Δt²) while "
        "δv is small against v: longer intervals give smaller errors. The unequal-interval denominator is wrong too.",
        text=[
            "Derivation: v = √(S/2)/Δt with S = r0² + r2² − 2·r1², so ∂v/∂r0 = r0/(2vΔt²), ∂v/∂r2 = r2/(2vΔt²), "
            "∂v/∂r1 = −r1/(vΔt²); their squares sum to (r0² + r2² + 4·r1²)/(4v²Δt⁴) = (S + 6·r1²)/(2SΔt²). In the "
            "paper Δt² multiplies instead of dividing, and 2·r0² + 2·r2² + 8·r1² is 2S + 12·r1², not 2S + 10·r1².",
            f"Unequal intervals, noise-free line at 2 m/s, ranges at t = 0, 0.4 and 1.5 s: the printed denominator "
            f"Δt1·Δt2 + Δt1² gives {printed:.2f} m/s, the derived one, Δt1·Δt2 + Δt2², gives {corrected:.2f} m/s. "
            "Algorithm 1 always has unequal intervals; with equal ones the two agree.",
            "Where δv is not small against v, the square root is biased upwards and S may be negative (last column).",
        ],
        tables=[_table(rows, f"{draws} draws, seed {seed}")],
        figures={"error_propagation": _figure(draws // 10, seed)},
        results={
            "unequal_intervals_mps": {"true": 2.0, "paper": printed, "corrected": corrected},
            "cases": [_result(case, errors) for case, errors in rows],
        },
    )


def _table(rows: list[tuple[Case, Sampled]], sampling: str) -> Table:
    return Table(
        f"Standard deviation of the speed, m/s ({sampling})",
        ["r0, m", "v, m/s", "Δt, s", "σ, m", "Monte Carlo", "corrected", "paper", "bias, m/s", "S < 0"],
        [
            [c.start_m, c.speed_mps, c.dt_s, c.sigma_m, m.std, corrected_std(c), paper_std(c), m.bias, m.negative]
            for c, m in rows
        ],
    )


def _result(case: Case, errors: Sampled) -> dict[str, float]:
    return {
        "start_m": case.start_m,
        "speed_mps": case.speed_mps,
        "dt_s": case.dt_s,
        "sigma_m": case.sigma_m,
        "monte_carlo_mps": errors.std,
        "corrected_mps": corrected_std(case),
        "paper_mps": paper_std(case),
        "bias_mps": errors.bias,
        "share_negative": errors.negative,
    }


def _figure(draws: int, seed: int) -> Figure:
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    cases = [Case(50.0, 2.0, float(dt), 0.1) for dt in np.geomspace(1.5, 12.0, 12)]
    dt = [case.dt_s for case in cases]
    axes.plot(dt, [sampled(case, draws, seed).std for case in cases], "ko", label="Monte Carlo")
    axes.plot(dt, [corrected_std(case) for case in cases], label="corrected")
    axes.plot(dt, [paper_std(case) for case in cases], "--", label="paper")
    axes.set(xscale="log", yscale="log", xlabel="Δt, s", ylabel="δv, m/s", title="r0 = 50 m, v = 2 m/s, σ = 0.1 m")
    axes.legend()
    return figure
