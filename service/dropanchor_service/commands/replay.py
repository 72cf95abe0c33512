"""`dropanchor replay`: run an engine on a recording, and report its error if the recording has a truth."""

import argparse
import csv
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from pydantic import ValidationError
from tqdm import tqdm

from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.commands.replay_mcap import files_of, replay_files
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.estimation.columns import Engine, State
from dropanchor_service.evaluation.accuracy import Accuracy, accuracy, share_of_time
from dropanchor_service.evaluation.replay import (
    Samples,
    Track,
    anchors_of,
    replay,
    samples_of,
    smoothed,
    smoothing_engine,
    track_of,
    truth_of,
)
from dropanchor_service.settings.engine_columns import tag_columns
from dropanchor_service.settings.sources import SettingsError, load_settings
from dropanchor_tag_client.recording import Recording, RecordingError, read_recording

DESCRIPTION = """\
Runs the engine of the service on a recording, as fast as possible, and reports its error if the recording has a truth.
A recording is a folder with range.csv and anchors.csv, and optionally imu.csv, heading.csv and truth.csv (plain or
gzipped). x and y are in the coordinates of anchors.csv.
A recording can also be an MCAP file from the service, or a folder of such files. All its tags then run with the site
and the settings of the recording; only --engine, --config and --out can be given.
"""
EPILOG = """\
examples:
  dropanchor replay recordings/yard --anchor 1 --start=10,0,1.57
  dropanchor replay recordings/yard --anchor 1 --start=10,0 --tag-height 1.2 --range-std 0.1 --out poses.csv
  dropanchor replay recordings/yard --anchor 1 --start=10,0 --smooth --out track.csv
  dropanchor replay yard-20270115T080000-000000Z.mcap --out poses.csv
  dropanchor-tag simulate --out recordings/yard      creates a recording with truth to try it on
"""
LAG_S, MAX_LAG_S = 2.0, 60.0
COLUMNS = ("t_s", "x", "y", "heading_rad", "speed_mps", "var_x", "cov_xy", "var_y", "p_mode", "state")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("recording", type=Path, metavar="RECORDING", help="folder of the recording, or MCAP file")
    add(
        "--anchor",
        action="append",
        metavar="ID",
        help="use the ranges of this anchor; may be repeated; needed if the recording has several anchors",
    )
    add("--engine", metavar="NAME", help="estimator: fleet (default) or paper")
    add(
        "--start",
        type=_start,
        metavar="X,Y[,HEADING]",
        help="start of the tag: m, m, rad counter-clockwise from east (default: unknown)",
    )
    add(
        "--heading",
        choices=("auto", "imu", "platform"),
        default="auto",
        help="source of the heading: the IMU, or heading.csv (default: auto, the IMU if the recording has one)",
    )
    _add_tag_settings(parser)
    _add_smoothing(parser)
    add("--out", type=Path, metavar="CSV", help=f"write the poses to this file: {','.join(COLUMNS)}")
    add("--plot", type=Path, metavar="PNG", help="write a picture of the track, with the truth if there is one")
    add("--config", type=Path, metavar="FILE", help="settings file of the service, for the engine's parameters")


def _add_tag_settings(parser: argparse.ArgumentParser) -> None:
    known = parser.add_argument_group("settings of the tag (measured range = scale · distance + bias)")
    known.add_argument("--tag-height", type=float, default=0.0, metavar="M", help="on the z axis of anchors.csv (0)")
    known.add_argument("--range-std", type=float, metavar="M", help="standard deviation of one range")
    known.add_argument("--range-bias", type=float, default=0.0, metavar="M")
    known.add_argument("--range-bias-std", type=float, metavar="M", help="standard deviation of the bias; 0: exact")
    known.add_argument("--range-scale", type=float, default=1.0, metavar="K")
    known.add_argument("--mount-angle", type=float, metavar="RAD", help="direction of travel minus body x axis")
    known.add_argument("--mount-angle-std", type=float, metavar="RAD", help="standard deviation of that; 0: exact")
    known.add_argument(
        "--lever-forward",
        type=float,
        default=0.0,
        metavar="M",
        help="distance of the tag in front of the point that follows the course",
    )
    known.add_argument("--lever-left", type=float, default=0.0, metavar="M", help="distance to the left of that point")
    known.add_argument("--slip-std", type=float, metavar="RAD", help="standard deviation of the slip angle; 0: no slip")
    known.add_argument(
        "--heading-std", type=float, metavar="RAD", help="error of a platform heading that does not drift"
    )
    known.add_argument("--speed-max", type=float, metavar="M/S", help="top speed of the tag")
    known.add_argument("--reverse", action="store_true", help="the tag may move backwards")


def _add_smoothing(parser: argparse.ArgumentParser) -> None:
    smoothing = parser.add_argument_group("smoothing (engine fleet): estimate each pose from later samples too")
    smoothing.add_argument("--smooth", action="store_true", help="use all samples of the recording")
    smoothing.add_argument(
        "--lag",
        type=_lag,
        nargs="?",
        const=LAG_S,
        metavar="S",
        help=f"with --smooth: use only samples up to S seconds after the pose ({LAG_S:g})",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the replay. Return 0 on success, 2 if the recording or the options are unusable, 130 on Ctrl-C."""
    if arguments.plot:
        import_module("dropanchor_service.evaluation.track_plot")  # fails early if matplotlib is missing
    try:
        files = files_of(arguments.recording)
        if files:
            _reject_options_of_folders(arguments)
            return replay_files(arguments, files)
        recording = read_recording(arguments.recording)
        anchors = arguments.anchor or _only_anchor(recording)
        samples = samples_of(recording, anchors)
        track = _track(arguments, recording, samples)
        return _conclude(arguments, recording, anchors, samples, track)
    except (RecordingError, SettingsError, OSError) as error:
        print(f"dropanchor replay: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return 130


def _reject_options_of_folders(arguments: argparse.Namespace) -> None:
    """Raise SettingsError for an option that an MCAP recording itself defines."""
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    defaults = parser.parse_args([str(arguments.recording)])
    for name, default in vars(defaults).items():
        if name not in ("engine", "out", "config") and getattr(arguments, name) != default:
            raise SettingsError(f"--{name.replace('_', '-')} cannot be given: the MCAP recording defines it")


def _track(arguments: argparse.Namespace, recording: Recording, samples: Samples) -> Track:
    if len(samples.batch.ranges) == 0:
        raise RecordingError(f"recording {recording.name} has no usable range to this anchor")
    engine = _engine(arguments)
    settings = tag_columns(_tag_settings(arguments), declination_rad=0.0)
    steps = []
    with tqdm(total=samples.end_s, unit="s", unit_scale=True, desc=f"{engine.name} on {recording.name}") as bar:
        for reached_s, poses in replay(engine, anchors_of(recording), settings, samples):
            steps.append(poses)
            bar.update(reached_s - bar.n)
    return smoothed(engine, arguments.lag) if arguments.smooth else track_of(steps)


def _engine(arguments: argparse.Namespace) -> Engine:
    if arguments.lag is not None and not arguments.smooth:
        raise SettingsError("--lag limits --smooth: give both")
    settings = load_settings(arguments.config, {"engine": arguments.engine} if arguments.engine else None)
    if not arguments.smooth:
        return create_engine(settings)
    if settings.engine != "fleet":
        raise SettingsError(f"--smooth works with the engine fleet only, not with {settings.engine}")
    return smoothing_engine()


def _tag_settings(arguments: argparse.Namespace) -> TagSettings:
    try:
        return TagSettings(
            height_m=arguments.tag_height,
            range_std_m=arguments.range_std,
            range_bias_m=arguments.range_bias,
            range_bias_std_m=arguments.range_bias_std,
            range_scale=arguments.range_scale,
            mount_angle_rad=arguments.mount_angle,
            mount_angle_std_rad=arguments.mount_angle_std,
            lever_forward_m=arguments.lever_forward,
            lever_left_m=arguments.lever_left,
            slip_std_rad=arguments.slip_std,
            speed_max_mps=arguments.speed_max,
            reverse_allowed=arguments.reverse,
            heading_source=arguments.heading,
            heading_std_rad=arguments.heading_std,
            start=arguments.start,
        )
    except ValidationError as error:
        first = error.errors()[0]
        raise SettingsError(f"{first['loc'][0]}: {first['msg']}") from error


def _conclude(
    arguments: argparse.Namespace, recording: Recording, anchors: Sequence[str], samples: Samples, track: Track
) -> int:
    if arguments.out:
        write_poses(arguments.out, track)
        print(f"{len(track.poses)} poses: {arguments.out}")
    truth = truth_of(recording)
    first = recording.anchor(anchors[0])
    result: Accuracy | None = None
    if truth is not None:
        try:
            result = accuracy(track.t, track.poses, truth, (first.x, first.y))
        except ValueError as error:
            print(f"no accuracy: {error}{_advice(arguments)}")
    for line in _report(track, result, samples):
        print(line)
    if arguments.plot:
        from dropanchor_service.evaluation.track_plot import plot_track

        title = f"{recording.name}, anchor {', '.join(anchors)}" + (f": RMSE {result.rmse:.2f} m" if result else "")
        used = anchors_of(recording)[[recording.anchors.index(recording.anchor(anchor)) for anchor in anchors]]
        plot_track(arguments.plot, title, track.t, track.poses, truth, used)
        print(f"picture: {arguments.plot}")
    return 0


def _advice(arguments: argparse.Namespace) -> str:
    return "" if arguments.start else "; the engine did not find the start: give --start X,Y,HEADING"


def _report(track: Track, result: Accuracy | None, samples: Samples) -> list[str]:
    lines = []
    if result is not None:
        lines += [
            f"RMSE {result.rmse:.3f} m (mean {result.mean:.3f}, median {result.median:.3f}, 95 % {result.p95:.3f}, "
            f"worst {result.worst:.3f}) over {result.compared} poses",
            f"RMSE while tracking {result.rmse_tracking:.3f} m; after the best rotation about the anchor "
            f"{result.rmse_rotated:.3f} m; ATE (best rigid motion) {result.ate:.3f} m",
            f"truth inside the 95 % ellipse: {result.coverage:.1%}",
        ]
    shares = share_of_time(track.t, track.poses["state"])
    lines.append("time: " + ", ".join(f"{name} {share:.1%}" for name, share in shares.items()))
    if samples.rejected:
        lines.append("not used: " + ", ".join(f"{count} {why}" for why, count in sorted(samples.rejected.items())))
    return lines


def write_poses(path: Path, track: Track) -> None:
    """Write one row per pose. An unknown number is `nan`. Raises OSError."""
    poses = track.poses
    cov = poses["cov"]
    columns = [track.t, *(poses[name] for name in ("x", "y", "heading", "speed"))]
    columns += [cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1], poses["p_mode"]]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for *numbers, state in zip(*(column.tolist() for column in columns), poses["state"].tolist(), strict=True):
            writer.writerow([*(f"{number:.6f}" for number in numbers), State(state).name.lower()])


def _start(text: str) -> StartPose:
    parts = text.split(",")
    if len(parts) not in (2, 3):
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y or X,Y,HEADING (m, m, rad)")
    try:
        x, y, *heading = (float(part) for part in parts)
        return StartPose(x=x, y=y, heading_rad=heading[0] if heading else None)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y or X,Y,HEADING (m, m, rad)") from error


def _lag(text: str) -> float:
    try:
        lag_s = float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds") from error
    if not 0.0 <= lag_s <= MAX_LAG_S:
        raise argparse.ArgumentTypeError(f"{text} s is not within 0 and {MAX_LAG_S:g} s")
    return lag_s


def _only_anchor(recording: Recording) -> list[str]:
    if len(recording.anchors) > 1:
        ids = ", ".join(anchor.id for anchor in recording.anchors)
        raise RecordingError(f"recording {recording.name} has several anchors, choose one with --anchor: {ids}")
    return [recording.anchors[0].id]
