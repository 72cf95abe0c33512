"""A recording, published as if its tag were here."""

import argparse
import math
import sys
import time
from array import array
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from heapq import merge
from operator import itemgetter

from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.options import add_connection_options, is_received, opened_client
from dropanchor_tag_client.progress import Progress
from dropanchor_tag_client.recording import Recording, read_recording

_NS_PER_S = 1_000_000_000


Event = tuple[float, Callable[..., None]]
"""When, s, and what publishes a sample: it takes the client and `t_ns`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", metavar="RECORDING", help="folder with range.csv, anchors.csv, imu.csv, …")
    parser.add_argument("--tag", help="id under which it is published (default: the name of the folder)")
    parser.add_argument("--anchor", metavar="ID", help="publish the ranges to this anchor only (default: all)")
    parser.add_argument(
        "--speed", type=_speed, default=1.0, metavar="N", help="N times real time; 0: as fast as possible (default: 1)"
    )
    parser.add_argument("--loop", action="store_true", help="start again at the end, until Ctrl-C")
    parser.add_argument(
        "--t0-ns",
        type=int,
        metavar="NS",
        help="UTC of the recording's t_s = 0, ns (default: so that the last sample is not in the future)",
    )
    add_connection_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Raises RecordingError, ConnectError, ValueError. Returns 1 when nobody receives the samples."""
    recording = read_recording(arguments.recording)
    for note in recording.notes:
        sys.stderr.write(f"{note}\n")
    if arguments.anchor is not None:
        recording.anchor(arguments.anchor)
    first_s, last_s = span(recording, arguments.anchor)
    t0_ns = arguments.t0_ns
    if t0_ns is None:
        t0_ns = time.time_ns() - round(_behind(arguments.speed) * (last_s - first_s) * _NS_PER_S)
        t0_ns -= round(first_s * _NS_PER_S)
    tag = arguments.tag or recording.name
    with opened_client(arguments, tag, replay=True, wait_when_congested=arguments.speed == 0) as client:
        while True:
            replay(client, recording, anchor=arguments.anchor, speed=arguments.speed, t0_ns=t0_ns)
            if not arguments.loop:
                break
            t0_ns += round((last_s - first_s) * _NS_PER_S) + _NS_PER_S // 10
        received = is_received(client)
    sys.stderr.write(f"{client.sent.samples} samples of {tag} in {client.sent.messages} messages\n")
    return 0 if received else 1


def replay(
    client: TagClient,
    recording: Recording,
    *,
    anchor: str | None = None,
    speed: float = 1.0,
    t0_ns: int,
) -> None:
    """Publishes the samples in order of time with their spacing divided by `speed` (0: no spacing).

    anchor: the one whose ranges are published; None: all. t0_ns: UTC of the recording's t_s = 0.
    """
    progress = Progress()
    first_s, last_s = span(recording, anchor)
    began_s = time.monotonic()
    for t_s, publish in timeline(recording, anchor):
        if speed > 0:
            time.sleep(max(0.0, began_s + (t_s - first_s) / speed - time.monotonic()))
        publish(client, t_ns=t0_ns + round(t_s * _NS_PER_S))
        share = (t_s - first_s) / (last_s - first_s) if last_s > first_s else 1.0
        progress.show(share, f"{t_s - first_s:.0f} of {last_s - first_s:.0f} s, {client.sent.samples} samples sent")
    client.flush()
    progress.end()


def timeline(recording: Recording, anchor: str | None = None) -> Iterator[Event]:
    """Every sample of the recording in order of time, with what publishes it; ranges after the others of their time,
    as they may be the last of a message."""
    samples = (_imu(recording), _headings(recording), _pressures(recording), _ranges(recording, anchor))
    return merge(*samples, key=itemgetter(0))


def span(recording: Recording, anchor: str | None = None) -> tuple[float, float]:
    """Times of the first and the last sample, s; (0, 0) without any."""
    times = [t_s for t_s, _ in timeline(recording, anchor)]
    return (times[0], times[-1]) if times else (0.0, 0.0)


def _imu(recording: Recording) -> Iterator[Event]:
    for t_s, *v in _rows(recording.imu, "ax", "ay", "az", "gx", "gy", "gz", "mx", "my", "mz"):
        mag = None if all(map(math.isnan, v[6:])) else v[6:]
        yield t_s, partial(TagClient.publish_imu, acc=v[0:3], gyro=v[3:6], mag=mag)


def _ranges(recording: Recording, only: str | None) -> Iterator[Event]:
    rows = _rows(recording.ranges, "range_m", "std_m")
    for anchor, (t_s, range_m, std_m) in zip(recording.range_anchors, rows, strict=True):
        if only in (None, anchor):
            yield t_s, partial(TagClient.publish_range, anchor=anchor, range_m=range_m, std_m=std_m)


def _headings(recording: Recording) -> Iterator[Event]:
    for t_s, yaw_rad, std_rad in _rows(recording.headings, "yaw_rad", "std_rad"):
        yield t_s, partial(TagClient.publish_heading, heading_rad=yaw_rad, std_rad=std_rad)


def _pressures(recording: Recording) -> Iterator[Event]:
    for t_s, pressure_pa, temperature_c in _rows(recording.pressures, "pressure_pa", "temperature_c"):
        yield t_s, partial(TagClient.publish_pressure, pressure_pa=pressure_pa, temperature_c=temperature_c)


def _rows(columns: Mapping[str, "array[float]"], *names: str) -> Iterator[tuple[float, ...]]:
    """Return the times and these columns, row by row; nothing of a file that the recording lacks."""
    return zip(*(columns[name] for name in ("t_s", *names)), strict=True) if columns else iter(())


def _behind(speed: float) -> float:
    """By which share of its length a replay must lie in the past to end at the present."""
    if speed == 0:
        return 1.0
    return max(0.0, 1.0 - 1.0 / speed)


def _speed(text: str) -> float:
    speed = float(text)
    if not 0 <= speed < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not 0 or a positive number")
    return speed
