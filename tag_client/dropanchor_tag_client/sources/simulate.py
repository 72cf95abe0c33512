"""Simulated tags that drive around one anchor: published live, or written as recordings."""

import argparse
import math
import os
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from threading import Thread

from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.host import program
from dropanchor_tag_client.options import add_connection_options, is_received, opened_session
from dropanchor_tag_client.simulator.azimuth import AzimuthModel
from dropanchor_tag_client.simulator.live import YARD, Delivery, deliveries, simulation, tag_name
from dropanchor_tag_client.simulator.perturbations import PERTURBATIONS, perturbed
from dropanchor_tag_client.simulator.ranging import AnchorPlace
from dropanchor_tag_client.simulator.recording import write_recording
from dropanchor_tag_client.simulator.scenarios import SCENARIOS
from dropanchor_tag_client.simulator.sensors import PRESETS, SensorModels, preset
from dropanchor_tag_client.upkeep import Upkeep


def add_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("simulation")
    group.add_argument("--tags", type=_count, default=1, metavar="N", help="how many, sim-1 to sim-N (default: 1)")
    group.add_argument(
        "--scenario",
        choices=[YARD, *SCENARIOS],
        default=YARD,
        help="how they move; the yard goes on for ever (default: %(default)s)",
    )
    group.add_argument("--seed", type=int, default=0, help="same seed, same motion (default: %(default)s)")
    group.add_argument(
        "--noise", choices=list(PRESETS), default="calibrated", help="of the sensors (default: %(default)s)"
    )
    group.add_argument(
        "--perturb",
        action="append",
        choices=list(PERTURBATIONS),
        default=[],
        help="what goes wrong beside noise; may be given several times",
    )
    group.add_argument("--range-hz", type=_positive, metavar="HZ", help="ranges per second (default: as --noise says)")
    group.add_argument("--imu-hz", type=_positive, metavar="HZ", help="IMU samples per second (default: 100)")
    group.add_argument("--anchor", default="1", metavar="ID", help="id of the anchor (default: %(default)s)")
    group.add_argument(
        "--azimuth", type=_positive, metavar="DEG", help="the anchor measures azimuths, too, with this error"
    )
    group.add_argument("--duration", type=_positive, metavar="S", help="end after so long")
    group.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="write a recording with the truth instead of publishing; several tags get a folder each in it",
    )
    group.add_argument(
        "--until-input-ends", action="store_true", help="end with the standard input, and so with whoever started it"
    )
    add_connection_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Raises ConnectError, ValueError. Returns 1 when nobody receives the samples."""
    models = sensors(arguments)
    if arguments.until_input_ends:
        Thread(target=_end_with_input, daemon=True).start()
    if arguments.out is not None:
        return _write(arguments, models)
    return _publish(arguments, models)


def _end_with_input() -> None:
    """End this process at once when the standard input ends: nobody is left whom closing a session could wait for."""
    sys.stdin.buffer.read()
    os._exit(0)


def sensors(arguments: argparse.Namespace) -> SensorModels:
    models = preset(arguments.noise, arguments.range_hz, arguments.imu_hz)
    azimuth = None if arguments.azimuth is None else AzimuthModel(math.radians(arguments.azimuth))
    return perturbed(replace(models, anchors=(AnchorPlace(arguments.anchor),), azimuth=azimuth), *arguments.perturb)


def _write(arguments: argparse.Namespace, models: SensorModels) -> int:
    for index in range(arguments.tags):
        folder = arguments.out / tag_name(index) if arguments.tags > 1 else arguments.out
        run = simulation(arguments.scenario, arguments.seed, index, models, arguments.duration)
        write_recording(run, folder, platform_heading=True)
        sys.stderr.write(f"{folder}: {run.truth.t_s[-1] - run.truth.t_s[0]:.0f} s, {len(run.ranges.t_s)} ranges\n")
    return 0


def _publish(arguments: argparse.Namespace, models: SensorModels) -> int:
    names = ", ".join(tag_name(index) for index in range(arguments.tags))
    sys.stderr.write(f"scenario {arguments.scenario}, {names} to {arguments.connect}; Ctrl-C ends\n")
    with ExitStack() as stack:
        session = stack.enter_context(opened_session(arguments))
        clients = [
            stack.enter_context(
                TagClient(
                    tag_name(index), site=arguments.site, connect=session, encoding=arguments.encoding, batch_s=None
                )
            )
            for index in range(arguments.tags)
        ]
        stack.enter_context(Upkeep(clients, lambda: {"firmware": program()}))
        publish_live(clients, arguments.scenario, arguments.seed, models, arguments.duration)
        return 0 if is_received(clients[0]) else 1


def publish_live(
    clients: Sequence[TagClient], scenario: str, seed: int, models: SensorModels, duration_s: float | None = None
) -> None:
    """Publishes the tags of a scenario in real time, one per open client, until it ends or `duration_s` is over."""
    t0_ns, began_s = time.time_ns(), time.monotonic()
    for delivery in deliveries(len(clients), scenario, seed, models, t0_ns):
        if duration_s is not None and delivery.due_s > duration_s:
            break
        time.sleep(max(0.0, began_s + delivery.due_s - time.monotonic()))
        send(clients[delivery.tag], delivery)


def send(client: TagClient, delivery: Delivery) -> None:
    """Publishes the samples of one delivery, now."""
    for t_ns, acc, gyro, mag in delivery.imu:
        client.publish_imu(acc, gyro, mag, t_ns=t_ns)
    for measured in delivery.ranges:
        client.publish_range(measured.anchor, measured.range_m, t_ns=measured.t_ns, std_m=measured.std_m)
    for t_ns, anchor, bearing_rad, std_rad in delivery.bearings:
        client.publish_bearing(anchor, bearing_rad, t_ns=t_ns, std_rad=std_rad)
    client.flush()


def _count(text: str) -> int:
    count = int(text)
    if count < 1:
        raise argparse.ArgumentTypeError(f"{text} is not 1 or more")
    return count


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value
