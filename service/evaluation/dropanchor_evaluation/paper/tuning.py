"""Tuned parameters of the EKF and of Algorithm 1 for scenario P, found on seeds that no table uses.

`python -m dropanchor_evaluation.paper.tuning` repeats the search and prints its results.
"""

from dataclasses import dataclass, replace

import numpy as np

from dropanchor_evaluation.paper.compiled import Estimate, algorithm1
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.paper.parameters import TUNED, PaperParameters
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate

TUNING_SEEDS = range(1000, 1008)
CANDIDATES = 200


@dataclass(frozen=True)
class Noise:
    """A sensor preset of the simulator and its standard deviations, m and rad."""

    preset: str
    range_std: float
    heading_std: float


STATED = Noise("paper", 0.2, 0.1)
RELEASED = Noise("released", 0.005, 0.01)


def base(noise: Noise) -> PaperParameters:
    """Return the parameters without a search: only the noise of the sensors is set."""
    return replace(TUNED, range_std=noise.range_std, heading_std=noise.heading_std, gate=np.inf)


def tuned(noise: Noise, speed_estimator: bool) -> PaperParameters:
    """Return the results of `search` for STATED and RELEASED."""
    found = base(noise)
    if speed_estimator:  # the same candidate won at both noises
        found = replace(found, q_position=2e-5, q_heading=6.5e-5, q_speed=0.71, q_turn_rate=26.0)
        found = replace(found, q_smooth=0.0069, r_smooth=noise.range_std**2, th_distance=1.2)
        return replace(found, window_base=8.2, window_ratio=0.042, blend=0.53)
    if noise == STATED:
        return replace(found, q_position=6.6e-5, q_heading=8.1e-5, q_speed=0.69, q_turn_rate=910.0)
    return replace(found, q_position=1.4e-5, q_heading=0.0024, q_speed=0.53, q_turn_rate=510.0)


def run(simulation: Simulation, parameters: PaperParameters, speed_estimator: bool) -> tuple[Estimate, Array]:
    """Return the estimate and its position error, (n,) m. It starts at the true position with the first heading."""
    t, heading = simulation.scalars.t_s, simulation.scalars.heading_rad
    ranges = np.full(len(t), np.nan)
    ranges[np.searchsorted(t, simulation.ranges.t_s - 1e-6)] = simulation.ranges.range_m
    truth = simulation.truth
    start = (float(truth.x[0]), float(truth.y[0]), float(heading[0]))
    estimate = algorithm1(t, heading, ranges, start, parameters, speed_estimator)
    return estimate, np.hypot(estimate.x - truth.x, estimate.y - truth.y)


def search(noise: Noise, speed_estimator: bool, candidates: int = CANDIDATES) -> PaperParameters:
    """Return the candidate with the lowest median RMSE over the tuning seeds. Candidates are log-uniform and seeded."""
    rng = np.random.default_rng(77)
    simulations = [simulate("P", seed, preset(noise.preset)) for seed in TUNING_SEEDS]
    drawn = [base(noise), *(_candidate(noise, speed_estimator, rng) for _ in range(candidates))]
    scores = [_score(simulations, parameters, speed_estimator) for parameters in drawn]
    return drawn[int(np.argmin(scores))]


def _candidate(noise: Noise, speed_estimator: bool, rng: np.random.Generator) -> PaperParameters:
    def log_uniform(low: float, high: float) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.2g}")

    parameters = replace(
        base(noise),
        q_position=log_uniform(1e-5, 1e-1),
        q_heading=log_uniform(1e-6, 1e-1),
        q_speed=log_uniform(1e-2, 1e2),
        q_turn_rate=log_uniform(1e-3, 1e3),
    )
    if not speed_estimator:
        return parameters
    return replace(
        parameters,
        q_smooth=log_uniform(1e-3, 1e1),
        r_smooth=noise.range_std**2,
        th_distance=log_uniform(0.05, 10.0),
        window_base=log_uniform(1.0, 20.0),
        window_ratio=log_uniform(0.01, 1.0),
        blend=float(f"{1 - log_uniform(0.01, 0.9):.2g}"),
    )


def _score(simulations: list[Simulation], parameters: PaperParameters, speed_estimator: bool) -> float:
    errors = (run(simulation, parameters, speed_estimator)[1] for simulation in simulations)
    return float(np.median([np.sqrt(np.nanmean(error**2)) for error in errors]))


if __name__ == "__main__":
    for noise in (STATED, RELEASED):
        for speed_estimator in (False, True):
            print(noise, speed_estimator, search(noise, speed_estimator))  # noqa: T201
