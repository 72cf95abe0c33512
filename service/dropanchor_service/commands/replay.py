"""`dropanchor replay`: run an engine on a recording, and report its error if the recording has a truth."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any

from tqdm import tqdm

from dropanchor_service.commands.replay_mcap import replay_files
from dropanchor_service.commands.replay_options import COLUMNS, DESCRIPTION, EPILOG, TAG_OPTIONS, add_arguments
from dropanchor_service.commands.replay_output import SOURCE, check, opened, values_of
from dropanchor_service.commands.replay_report import no_usable_range, report, score_of
from dropanchor_service.commands.replay_source import mcap_files_of
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.estimation.columns import Array
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.offline.prepared import prepared, with_units
from dropanchor_service.offline.replay import (
    NS_PER_S,
    Samples,
    Track,
    anchors_of,
    replay,
    smoothed,
    smoothing_engine,
    track_of,
    truth_of,
)
from dropanchor_service.offline.sensors import CheckedEngine, known_from_start
from dropanchor_service.settings.engine_columns import tag_columns
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings
from dropanchor_tag_client.recording import Recording, RecordingError, read_recording

__all__ = ["COLUMNS", "DESCRIPTION", "EPILOG", "add_arguments", "run"]


def run(arguments: argparse.Namespace) -> int:
    """Run the replay. Return 0 on success, 2 if the recording or the options are unusable, 130 on Ctrl-C."""
    if arguments.plot:
        import_module("dropanchor_service.offline.track_plot")  # fails early if matplotlib is missing
    try:
        if arguments.out:
            check(arguments.out)
        files = mcap_files_of(arguments.recording)
        if files:
            _reject_options_of_folders(arguments)
            return replay_files(arguments, files)
        return _replay_folder(arguments)
    except (RecordingError, SettingsError, OSError) as error:
        print(f"dropanchor replay: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return 130


def _replay_folder(arguments: argparse.Namespace) -> int:
    recording = read_recording(arguments.recording)
    anchors = arguments.anchor or _only_anchor(recording)
    settings = _settings(arguments)
    tag, site = settings.tag_defaults, settings.site
    columns = tag_columns(tag, site.declination_rad, site.declination_std_rad)
    ready = prepared(with_units(recording, columns), anchors, arguments.clock_offset)
    for sentence in ready.sentences:
        print(sentence)
    track = _track(arguments, _engine(arguments, settings), recording, ready.samples, columns)
    return _conclude(arguments, recording, anchors, ready.samples, track, start_is_given=tag.start is not None)


def _reject_options_of_folders(arguments: argparse.Namespace) -> None:
    """Raise SettingsError for an option that an MCAP recording itself defines."""
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    defaults = parser.parse_args([str(arguments.recording)])
    for name, default in vars(defaults).items():
        if name not in ("engine", "out", "config") and getattr(arguments, name) != default:
            raise SettingsError(f"--{name.replace('_', '-')} cannot be given: the MCAP recording defines it")


def _track(
    arguments: argparse.Namespace, inner: Engine, recording: Recording, samples: Samples, settings: Array
) -> Track:
    if len(samples.batch.ranges) == 0:
        raise RecordingError(no_usable_range(recording.name, samples))
    engine = CheckedEngine(inner, known_from_start(samples, bool(settings["acc_sign_told"])))
    steps = []
    total_s = samples.end_s - samples.start_s
    print(f"engine {engine.name} on {recording.name}, {total_s:.0f} s")
    with tqdm(total=total_s, unit="s", unit_scale=True, disable=None) as bar:  # None: only on a terminal
        for reached_s, poses in replay(engine, anchors_of(recording), settings, samples):
            steps.append(poses)
            bar.update(reached_s - samples.start_s - bar.n)
    for since_s, finding in engine.found.values():
        print(f"from {since_s + samples.zero_ns / NS_PER_S:.1f} s on: {finding.sentence}")
    return smoothed(inner, arguments.lag, samples.zero_ns) if arguments.smooth else track_of(steps, samples.zero_ns)


def _engine(arguments: argparse.Namespace, settings: Settings) -> Engine:
    if arguments.lag is not None and not arguments.smooth:
        raise SettingsError("--lag limits --smooth: give both")
    if not arguments.smooth:
        return create_engine(settings)
    if settings.engine != "fleet":
        raise SettingsError(f"--smooth works with the engine fleet only, not with {settings.engine}")
    return smoothing_engine()


def _settings(arguments: argparse.Namespace) -> Settings:
    """Return the settings of --config, and above them those of the other options."""
    told = {field: getattr(arguments, option) for field, option in TAG_OPTIONS.items()}
    given: dict[str, Any] = {"tag_defaults": {field: value for field, value in told.items() if value is not None}}
    if arguments.declination is not None:
        given["site"] = {"declination_rad": arguments.declination}
    if arguments.engine:
        given["engine"] = arguments.engine
    return load_settings(arguments.config, given)


def _conclude(
    arguments: argparse.Namespace,
    recording: Recording,
    anchors: Sequence[str],
    samples: Samples,
    track: Track,
    start_is_given: bool,
) -> int:
    if arguments.out:
        with opened(arguments.out, COLUMNS if track.smoothed is None else (*COLUMNS, SOURCE)) as write:
            write([t, *values] for t, values in zip(track.t.tolist(), _values(track), strict=True))
        print(f"{len(track.poses)} poses: {arguments.out}")
    first = recording.anchor(anchors[0])
    score = score_of(track, truth_of(recording), (first.x, first.y))
    for line in report(track, score, samples, start_is_given):
        print(line)
    if arguments.plot:
        from dropanchor_service.offline.track_plot import plot_track

        title = f"{recording.name}, anchor {', '.join(anchors)}{score.title()}"
        used = anchors_of(recording)[[recording.anchors.index(recording.anchor(anchor)) for anchor in anchors]]
        plot_track(arguments.plot, title, track.t, track.poses, truth_of(recording), used)
        print(f"picture: {arguments.plot}")
    return 0


def _values(track: Track) -> Iterator[list[Any]]:
    """Yield VALUES of each pose, with its source if the track was smoothed."""
    values = values_of(track.poses)
    if track.smoothed is None:
        return values
    return ([*one, "smoothed" if later else "filtered"] for one, later in zip(values, track.smoothed, strict=True))


def _only_anchor(recording: Recording) -> list[str]:
    if len(recording.anchors) > 1:
        ids = ", ".join(anchor.id for anchor in recording.anchors)
        raise RecordingError(f"recording {recording.name} has several anchors, choose one with --anchor: {ids}")
    return [recording.anchors[0].id]
