"""The estimators that are compared on simulated runs, each behind `run(simulations, known) -> Timed`."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from dropanchor_service.estimation.columns import POSE, Array, Engine, State
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_service.evaluation.paper import tuning
from dropanchor_service.evaluation.paper.compiled import Estimate
from dropanchor_service.evaluation.pcrb import Information
from dropanchor_service.evaluation.replay import NS_PER_S, Track
from dropanchor_service.evaluation.simulated import Feed, Known, Timed, run_engine
from dropanchor_tag_client.simulator.simulation import Simulation

JUMPS_KNOWN: Information = "range+heading, jumps known"
WITH_ACCELEROMETER: Information = "with accelerometer"


class Contestant(Protocol):
    """information: what it measures, for the bound it is held against, None for none."""

    @property
    def information(self) -> Information | None: ...
    def run(self, simulations: Sequence[Simulation], known: Known) -> Timed: ...


@dataclass(frozen=True)
class Paper:
    """Algorithm 1, compiled, or the vanilla EKF. It gets the scalar headings and the ranges and nothing else."""

    parameters: PaperParameters
    speed_estimator: bool
    information: Information | None = JUMPS_KNOWN

    def run(self, simulations: Sequence[Simulation], known: Known) -> Timed:  # noqa: ARG002
        started = time.process_time()
        estimates = [tuning.run(one, self.parameters, self.speed_estimator)[0] for one in simulations]
        seconds = time.process_time() - started
        return Timed([_track(one, e) for one, e in zip(simulations, estimates, strict=True)], seconds)


@dataclass(frozen=True)
class OfEngine:
    """An engine of the product, with an IMU. The bound is one for scalar sensors."""

    create: Callable[[], Engine]
    feed: Feed
    calibrated: bool = False

    @property
    def information(self) -> Information | None:
        return WITH_ACCELEROMETER if self.feed == "level" else None

    def run(self, simulations: Sequence[Simulation], known: Known) -> Timed:
        return run_engine(self.create(), simulations, replace(known, feed=self.feed, calibrated=self.calibrated))


def engines() -> dict[str, OfEngine]:
    """The engine of the product beside the paper's: with the scalar sensors, of a tag of which nothing is told and of a
    calibrated one; and with raw 9-axis samples."""
    return {
        "fleet": OfEngine(FleetEngine, "level"),
        "fleet, calibrated": OfEngine(FleetEngine, "level", calibrated=True),
        "fleet, raw 9-axis": OfEngine(FleetEngine, "raw"),
    }


def contestants(noise: tuning.Noise) -> dict[str, Contestant]:
    """By name: the paper's two with the authors' parameters and tuned for this noise, then our engines."""
    entered: dict[str, Contestant] = {
        f"{name}, {which}": Paper(parameters, speed_estimator)
        for which in ("authors'", "tuned")
        for name, speed_estimator in (("vanilla EKF", False), ("Algorithm 1", True))
        for parameters in [PaperParameters() if which == "authors'" else tuned_for(noise, speed_estimator)]
    }
    return {**entered, **engines()}


def tuned_for(noise: tuning.Noise, speed_estimator: bool) -> PaperParameters:
    """What was tuned at the stated noise, with the standard deviations of this one; nothing else is tuned again."""
    found = tuning.tuned(tuning.STATED, speed_estimator)
    return replace(found, range_std=noise.range_std, heading_std=noise.heading_std, r_smooth=noise.range_std**2)


def _track(simulation: Simulation, estimate: Estimate) -> Track:
    """The estimate at the instants of the ranges."""
    ranges = simulation.ranges
    at = np.searchsorted(simulation.scalars.t_s, ranges.t_s - 1e-6)
    poses: Array = np.zeros(len(at), POSE)
    poses["t_ns"] = np.rint(ranges.t_s * NS_PER_S)
    poses["state"] = State.TRACKING
    poses["range"], poses["cov"] = ranges.range_m, np.nan
    poses["x"], poses["y"], poses["heading"], poses["speed"] = (
        column[at] for column in (estimate.x, estimate.y, estimate.theta, estimate.v)
    )
    poses["cov"][:, :2, :2] = estimate.cov[at]
    return Track(ranges.t_s, poses)
