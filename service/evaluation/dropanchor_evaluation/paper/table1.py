"""Table I, simulation, and Fig. 7: the paper's five-stage trajectory at the stated and at the released noise."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from dropanchor_evaluation.paper.tuning import RELEASED, STATED, Noise, tuned
from dropanchor_evaluation.paper.tuning import run as run_algorithm1
from dropanchor_evaluation.report import Section, Table
from dropanchor_evaluation.simulated import PriorKnowledge, run_engine
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.estimation.paper.parameters import PaperParameters
from dropanchor_tag_client.simulator.sensors import preset
from dropanchor_tag_client.simulator.simulation import Simulation, simulate

PAPER = {"vanilla EKF": 1.73, "Algorithm 1": 0.48}
FLEET, CALIBRATED = "fleet", "fleet, calibrated"
SEEDS = range(20)
RUNS_PER_SEED = 2 * 6  # noises times estimators


@dataclass(frozen=True)
class Run:
    """One run: time, true speed, estimated speed and position error, (n,) each, in SI units."""

    t: Array
    true_speed: Array
    speed: Array
    error: Array

    @property
    def mean(self) -> float:
        return float(self.error.mean())

    @property
    def rmse(self) -> float:
        return float(np.sqrt((self.error**2).mean()))


Runner = Callable[[Simulation], Run]


def algorithm1_runner(parameters: PaperParameters, speed_estimator: bool) -> Runner:
    def runner(simulation: Simulation) -> Run:
        estimate, error = run_algorithm1(simulation, parameters, speed_estimator)
        return Run(simulation.truth.t_s, simulation.truth.v, estimate.v, error)

    return runner


def fleet_runner(noise: Noise, calibrated: bool) -> Runner:
    """Return a runner of the engine fleet, which also uses gyro and accelerometer, at the instants of the ranges."""

    def runner(simulation: Simulation) -> Run:
        known = PriorKnowledge(feed="level", heading_std=noise.heading_std, calibrated=calibrated)
        (track,) = run_engine(FleetEngine(), [simulation], known).tracks
        truth, poses = simulation.truth, track.poses
        x, y, speed = (np.interp(track.t, truth.t_s, column) for column in (truth.x, truth.y, truth.v))
        return Run(track.t, speed, poses["speed"], np.hypot(poses["x"] - x, poses["y"] - y))

    return runner


def runners(noise: Noise) -> dict[str, Runner]:
    papers = {
        f"{name}, {which} parameters": algorithm1_runner(parameters, speed_estimator)
        for which in ("the authors'", "tuned")
        for name, speed_estimator in (("vanilla EKF", False), ("Algorithm 1", True))
        for parameters in [PaperParameters() if which == "the authors'" else tuned(noise, speed_estimator)]
    }
    return {**papers, FLEET: fleet_runner(noise, False), CALIBRATED: fleet_runner(noise, True)}


def run(progress: Callable[[], None] = lambda: None, seeds: range = SEEDS) -> Section:
    """Run all estimators at both noises. progress: called after each of the `RUNS_PER_SEED · len(seeds)` runs."""
    found = _run_all(progress, seeds)
    numbers = {label: {name: _numbers(runs) for name, runs in by_name.items()} for label, by_name in found.items()}
    return Section(
        key="table1",
        title="Table I, simulation: the five-stage trajectory",
        paper="RMSE 1.73 m without and 0.48 m with the speed estimator, at noise of 0.2 m and 0.1 rad.",
        finding=_finding(numbers),
        text=[
            "Stage values are those of the authors' released simulation. Its data has noise of 0.005 m and 0.01 rad, "
            "not 0.2 m and 0.1 rad as the paper says; and what its script prints as RMSE is the mean error. Both "
            "measures are given here for both noises.",
            f"Medians over seeds {seeds.start} to {seeds.stop - 1}. Tuned: by random search on seeds 1000 to 1007.",
            "Differences from the released program: five states with w, heading initialised by the first measurement, "
            "a mean instead of a median window, no speed where v² < 0.",
            f"{FLEET}: the engine of the service, which also uses the gyro and the forward accelerometer of a tag with "
            "a known mounting angle; calibrated: its settings state that the tag never slips, that its ranges have no "
            "bias, and that its heading has only white noise. This is true here, and the other estimators assume it.",
        ],
        tables=[
            Table(
                f"Noise {noise.range_std} m, {noise.heading_std} rad ({label}): position error, m",
                ["estimator", "mean error", "RMSE", "RMSE, worst seed", "speed RMSE, m/s", "the paper"],
                [
                    [name, n["mean"], n["rmse"], n["worst_rmse"], n["speed_rmse"], PAPER.get(name.split(",")[0], "")]
                    for name, n in numbers[label].items()
                ],
            )
            for label, noise in (("stated", STATED), ("released", RELEASED))
        ],
        figures={f"fig7_{label}": _figure(label, by_name) for label, by_name in found.items()},
        results=numbers,
    )


def _run_all(progress: Callable[[], None], seeds: range) -> dict[str, dict[str, list[Run]]]:
    """Return the runs by noise and estimator."""
    found: dict[str, dict[str, list[Run]]] = {}
    for label, noise in (("stated", STATED), ("released", RELEASED)):
        simulations = [simulate("P", seed, preset(noise.preset)) for seed in seeds]
        found[label] = {}
        for name, runner in runners(noise).items():
            found[label][name] = []
            for simulation in simulations:
                found[label][name].append(runner(simulation))
                progress()
    return found


def _numbers(runs: list[Run]) -> dict[str, float]:
    speed = [np.sqrt(((one.speed - one.true_speed) ** 2).mean()) for one in runs]
    return {
        "mean": float(np.median([one.mean for one in runs])),
        "rmse": float(np.median([one.rmse for one in runs])),
        "worst_rmse": max(one.rmse for one in runs),
        "speed_rmse": float(np.median(speed)),
    }


def _finding(numbers: dict[str, dict[str, dict[str, float]]]) -> str:
    def mean(label: str, name: str) -> float:
        return numbers[label][name]["mean"]

    theirs, tuned_ = "the authors' parameters", "tuned parameters"
    return (
        f"At the noise of the released data the picture of the paper returns (mean error "
        f"{mean('released', f'vanilla EKF, {theirs}'):.2f} m without, "
        f"{mean('released', f'Algorithm 1, {theirs}'):.2f} m with); at the stated noise the same parameters give "
        f"{mean('stated', f'vanilla EKF, {theirs}'):.0f} m and {mean('stated', f'Algorithm 1, {theirs}'):.1f} m. "
        f"Tuned, the difference all but vanishes: {mean('stated', f'vanilla EKF, {tuned_}'):.2f} m and "
        f"{mean('stated', f'Algorithm 1, {tuned_}'):.2f} m: most of the gain was a badly tuned baseline. "
        f"The engine {FLEET}: {mean('released', FLEET):.2f} m and {mean('stated', FLEET):.2f} m. "
        "What no tuning cures is a run on the wrong side of the anchor: see the worst seeds."
    )


def _figure(label: str, by_name: dict[str, list[Run]]) -> Figure:
    figure = Figure(figsize=(11, 6), layout="constrained")
    figure.suptitle(f"speed and error over time, {label} noise, one seed")
    speed, error = figure.subplots(2, 1, sharex=True)
    for name, runs in by_name.items():
        speed.plot(runs[0].t, runs[0].speed, linewidth=0.9, label=name)
        error.plot(runs[0].t, runs[0].error, linewidth=0.9)
    first = next(iter(by_name.values()))[0]
    speed.plot(first.t, first.true_speed, color="0.5", linewidth=2, zorder=0, label="truth")
    speed.set(ylabel="speed, m/s", ylim=(-2, 14))
    speed.legend(loc="upper left", fontsize="small", ncols=2)
    error.set(xlabel="t, s", ylabel="error, m", yscale="log")
    return figure
