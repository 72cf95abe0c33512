"""Real recordings, one anchor at a time: simple filters, the paper's two, and the engine fleet."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from dropanchor_evaluation.baselines import stays, walks
from dropanchor_evaluation.operator_knowledge import BEATEN, apply_operator_knowledge, family_of
from dropanchor_evaluation.paper.engines import engines
from dropanchor_evaluation.parallel import Workers
from dropanchor_evaluation.report import Cell, Section, Table
from dropanchor_service.estimation.columns import Array, default_settings
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.offline.accuracy import Truth, accuracy
from dropanchor_service.offline.replay import Samples, Track, anchors_of, replay, samples_of, track_of, truth_of
from dropanchor_tag_client.recording import Anchor, Recording, RecordingError, read_recording

AUTHORS = "authors'"
SAME_M = 0.05
BETTER = 0.9  # of an error: what is below that much of another's is better
STAYS, WALKS, FLEET = "stays at its start", "steps and compass", "fleet"
ESTIMATORS = (STAYS, WALKS, *engines())


@dataclass(frozen=True)
class Numbers:
    """Accuracy of one estimator. ate, rmse: m; coverage: share of the truth inside the 95 % ellipse. NaN: no position.

    tracking: share of the time in that state.
    """

    ate: float = np.nan
    rmse: float = np.nan
    coverage: float = np.nan
    tracking: float = np.nan


Results = dict[str, dict[str, Numbers]]
"""Results of one recording, by anchor, then by estimator."""


def recordings_in(folder: Path) -> list[Path]:
    """Return the folders of recordings with a truth, or none if the folder is missing."""
    truths = [*folder.glob("*/truth.csv"), *folder.glob("*/truth.csv.gz")]
    return sorted({truth.parent for truth in truths})


def compared(recording: Recording, anchors: int | None = None) -> Results:
    """Run all engines on each of the first `anchors` anchors. Raises RecordingError without a truth."""
    truth = truth_of(recording)
    if truth is None:
        raise RecordingError(f"recording {recording.name} has no truth to compare with")
    return {
        anchor.id: _by_estimator(recording, anchor, truth)
        for anchor in recording.anchors[:anchors]
        if anchor.id in recording.range_anchors
    }


def _by_estimator(recording: Recording, anchor: Anchor, truth: Truth) -> dict[str, Numbers]:
    samples = samples_of(recording, [anchor.id])
    settings = settings_of(recording, float(samples.batch.ranges["t_ns"][0]) * 1e-9)
    start = float(settings["start_x"]), float(settings["start_y"])
    tracks: dict[str, Track | None] = {
        STAYS: stays(samples, start),
        WALKS: walks(samples, start, (anchor.x, anchor.y, anchor.z - float(settings["height"]))),
        **{name: _track(create(), recording, settings, samples) for name, create in engines().items()},
    }
    return {name: _numbers(track, truth, (anchor.x, anchor.y)) for name, track in tracks.items()}


def _track(engine: Engine, recording: Recording, settings: Array, samples: Samples) -> Track:
    return track_of([poses for _, poses in replay(engine, anchors_of(recording), settings, samples)])


def _numbers(track: Track | None, truth: Truth, anchor: tuple[float, float]) -> Numbers:
    if track is None:
        return Numbers()
    try:
        found = accuracy(track.t, track.poses, truth, anchor)
    except ValueError:
        return Numbers()
    coverage = found.coverage if np.isfinite(track.poses["cov"][:, 0, 0]).any() else np.nan
    return Numbers(found.ate, found.rmse, coverage, found.share_of_time.get("tracking", 0.0))


def settings_of(recording: Recording, t: float) -> Array:
    """Return TAG_SETTINGS: the true start at the time t, s, the mean height, and the operator's knowledge."""
    truth = {name: np.asarray(column) for name, column in recording.truth.items()}
    height = float(np.nanmean(truth["z"])) if np.isfinite(truth["z"]).any() else 0.0
    settings = default_settings()
    settings["height"] = height
    settings["start_known"] = True
    settings["start_x"], settings["start_y"] = (np.interp(t, truth["t_s"], truth[name]) for name in ("x", "y"))
    settings["start_heading"] = truth["yaw_rad"][np.argmin(np.abs(truth["t_s"] - t))]
    apply_operator_knowledge(recording.name, settings)
    return settings


@dataclass(frozen=True)
class Task:
    folder: Path
    anchors: int | None


def work(task: Task) -> Results:
    return compared(read_recording(task.folder), task.anchors)


def run(workers: Workers, progress: Callable[[], None], folders: Sequence[Path], anchors: int | None = None) -> Section:
    """Evaluate all engines on recordings. Raises RecordingError.

    progress: called after each folder. anchors: number of anchors of each recording; None: all.
    """
    todo = [Task(folder, anchors) for folder in folders]
    return _section([folder.name for folder in folders], workers.map(work, todo), progress)


def run_read(workers: Workers, progress: Callable[[], None], read: Sequence[Recording]) -> Section:
    """Evaluate all engines on recordings that are already read."""
    return _section([one.name for one in read], workers.map(compared, read), progress)


def _section(names: Sequence[str], results: Iterable[Results], progress: Callable[[], None]) -> Section:
    found = {}
    for name, result in zip(names, results, strict=True):
        found[name] = result
        progress()
    return section(found)


def section(found: dict[str, Results]) -> Section:
    return Section(
        key="recordings",
        title="Real recordings: each anchor alone, with and without the speed estimator",
        paper="ATE of the drone 2.81 m without and 1.05 m with the speed estimator.",
        finding=_finding(found) if found else "No recordings are here; give their folder with --data.",
        text=[
            "Start and heading zero are given; range bias, mounting angle and noise are not taken from the truth. "
            "Configured, as an operator could: a top speed; Plaza: the scale of its radios, 1.069, and 0.6 m; the "
            "mower: an IMU along its wheels; starloc: a rig held 0.6 m in front of the walker; Hanyang: a heading "
            "that is the direction of travel; cf: that it flies in any direction. Heading: that of each engine's own "
            "attitude filter where the recording has an IMU, else that of the platform (Plaza's drifts by 0.3 °/s). "
            "Tuned: the service's tuned parameters, the same for all; their speed estimator wants ranges that change "
            "by 2 m on a line, so it says nothing in small rooms. Steps and compass: 0.65 m a step along the "
            "tilt-compensated compass, corrected by the ranges. RMSE is without any alignment. The engine fleet was "
            "developed on recordings of this kind: a development set, not a blind test.",
        ],
        tables=[_by_sequence(found, "RMSE"), _beaten(found), _by_sequence(found, "ATE"), _by_anchor(found)]
        if found
        else [],
        results={
            name: {anchor: {engine: asdict(n) for engine, n in by.items()} for anchor, by in results.items()}
            for name, results in found.items()
        },
    )


def _finding(found: dict[str, Results]) -> str:
    pairs = [by for results in found.values() for by in results.values()]

    def of(which: str) -> str:
        without = np.array([by[f"vanilla EKF, {which}"].ate for by in pairs])
        with_it = np.array([by[f"Algorithm 1, {which}"].ate for by in pairs])
        share = [np.mean(with_it < without - SAME_M), np.mean(with_it > without + SAME_M)]
        return (
            f"{which}: median ATE {np.nanmedian(without):.2f} m without, {np.nanmedian(with_it):.2f} m with the speed "
            f"estimator, better by more than {SAME_M} m in {share[0]:.0%}, worse in {share[1]:.0%}"
        )

    fleet = np.nanmedian([by["fleet"].ate for by in pairs])
    return f"{len(pairs)} pairs of sequence and anchor. {of(AUTHORS)}; {of('tuned')}. Engine fleet: {fleet:.2f} m."


def _by_sequence(found: dict[str, Results], measure: str) -> Table:
    def cell(results: Results, estimator: str) -> str:
        values = [getattr(by[estimator], measure.lower()) for by in results.values()]
        return f"{np.median(values):.2f} ({max(values):.2f})" if np.isfinite(values).all() else "–"

    def share(results: Results, of: str) -> str:
        return f"{np.mean([getattr(by[FLEET], of) for by in results.values()]):.0%}"

    return Table(
        f"{measure}, m: median (worst) over the anchors of a sequence",
        [
            "sequence",
            "anchors",
            *ESTIMATORS,
            "fleet's 95 % ellipses cover",
            "fleet is `tracking`",
        ],
        [
            [
                name,
                len(results),
                *(cell(results, estimator) for estimator in ESTIMATORS),
                share(results, "coverage"),
                share(results, "tracking"),
            ]
            for name, results in found.items()
        ],
    )


def _beaten(found: dict[str, Results]) -> Table:
    """Return where a simpler filter has a median error below `BETTER` of that of the fleet."""

    def median(results: Results, estimator: str) -> float:
        return float(np.median([by[estimator].rmse for by in results.values()]))

    def best(results: Results) -> str:
        return min(ESTIMATORS, key=lambda one: np.nan_to_num(median(results, one), nan=np.inf))

    rows: list[list[Cell]] = [
        [
            name,
            best(results),
            median(results, best(results)),
            median(results, FLEET),
            BEATEN.get(family_of(name), "–"),
        ]
        for name, results in found.items()
        if median(results, best(results)) < BETTER * median(results, FLEET)
    ]
    return Table(
        f"Where a simpler filter has less than {BETTER:.0%} of the fleet's RMSE, m, median over the anchors",
        ["sequence", "the best one", "its RMSE", "fleet", "why"],
        rows,
    )


def _by_anchor(found: dict[str, Results]) -> Table:
    def cells(by: dict[str, Numbers]) -> list[Cell]:
        return [_cell(n) for n in by.values()]

    return Table(
        "By anchor: ATE, m / RMSE, m / 95 % coverage",
        ["sequence", "anchor", *ESTIMATORS],
        [[name, anchor, *cells(by)] for name, results in found.items() for anchor, by in results.items()],
    )


def _cell(n: Numbers) -> str:
    if np.isnan(n.rmse):
        return "–"
    return f"{n.ate:.2f} / {n.rmse:.2f} / " + ("–" if np.isnan(n.coverage) else f"{n.coverage:.0%}")
