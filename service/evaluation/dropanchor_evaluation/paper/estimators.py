"""The estimators that the report compares on simulated runs, with a common `run(simulations, known) -> Timed`."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from dropanchor_evaluation.paper import tuning
from dropanchor_evaluation.paper.compiled import Estimate
from dropanchor_evaluation.pcrb import Information
from dropanchor_evaluation.simulated import Feed, PriorKnowledge, Timed, run_engine
from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.offline.replay import NS_PER_S, Track
from dropanchor_tag_client.simulator.simulation import Simulation

JUMPS_KNOWN: Information = "range+heading, jumps known"
WITH_ACCELEROMETER: Information = "with accelerometer"


class Estimator(Protocol):
    """An estimator to compare. information: the measurements for its bound; None: no bound."""

    @property
    def information(self) -> Information | None: ...
    def run(self, simulations: Sequence[Simulation], known: PriorKnowledge) -> Timed: ...


@dataclass(frozen=True)
class PaperEstimator:
    """Algorithm 1, compiled, or the vanilla EKF. It uses only the scalar headings and the ranges."""

    parameters: PaperParameters
    speed_estimator: bool
    information: Information | None = JUMPS_KNOWN

    def run(self, simulations: Sequence[Simulation], known: PriorKnowledge) -> Timed:  # noqa: ARG002
        started = time.process_time()
        estimates = [tuning.run(one, self.parameters, self.speed_estimator)[0] for one in simulations]
        seconds = time.process_time() - started
        return Timed([_track(one, e) for one, e in zip(simulations, estimates, strict=True)], seconds)


@dataclass(frozen=True)
class EngineEstimator:
    """An engine of the service, with an IMU. The bound is that of scalar sensors."""

    create: Callable[[], Engine]
    feed: Feed
    calibrated: bool = False

    @property
    def information(self) -> Information | None:
        return WITH_ACCELEROMETER if self.feed == "level" else None

    def run(self, simulations: Sequence[Simulation], known: PriorKnowledge) -> Timed:
        return run_engine(self.create(), simulations, replace(known, feed=self.feed, calibrated=self.calibrated))


def engines() -> dict[str, EngineEstimator]:
    """Return the engine fleet by variant: scalar sensors with default settings, a calibrated tag, and raw 9-axis
    samples."""
    return {
        "fleet": EngineEstimator(FleetEngine, "level"),
        "fleet, calibrated": EngineEstimator(FleetEngine, "level", calibrated=True),
        "fleet, raw 9-axis": EngineEstimator(FleetEngine, "raw"),
    }


def estimators(noise: tuning.Noise) -> dict[str, Estimator]:
    """Return all estimators by name: the paper's two, with the authors' and with tuned parameters, then our engines."""
    found: dict[str, Estimator] = {
        f"{name}, {which}": PaperEstimator(parameters, speed_estimator)
        for which in ("authors'", "tuned")
        for name, speed_estimator in (("vanilla EKF", False), ("Algorithm 1", True))
        for parameters in [PaperParameters() if which == "authors'" else tuned_for(noise, speed_estimator)]
    }
    return {**found, **engines()}


def tuned_for(noise: tuning.Noise, speed_estimator: bool) -> PaperParameters:
    """Return the parameters tuned at the stated noise, with the standard deviations of this noise."""
    found = tuning.tuned(tuning.STATED, speed_estimator)
    return replace(found, range_std=noise.range_std, heading_std=noise.heading_std, r_smooth=noise.range_std**2)


def _track(simulation: Simulation, estimate: Estimate) -> Track:
    """Return the estimate at the instants of the ranges."""
    ranges = simulation.ranges
    at = np.searchsorted(simulation.scalars.t_s, ranges.t_s - 1e-6)
    poses: Array = np.zeros(len(at), POSE)
    poses["t_ns"] = np.rint(ranges.t_s * NS_PER_S)
    poses["state"] = State.TRACKING
    poses["range"], poses["cov"], poses["z"], poses["z_std"] = ranges.range_m, np.nan, np.nan, np.nan
    poses["x"], poses["y"], poses["heading"], poses["speed"] = (
        column[at] for column in (estimate.x, estimate.y, estimate.theta, estimate.v)
    )
    poses["cov"][:, :2, :2] = estimate.cov[at]
    return Track(ranges.t_s, poses)
