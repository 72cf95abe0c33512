"""`dropanchor demo`: the service with simulated tags, to look at in a browser."""

import argparse
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.api.http.server import ListenError
from dropanchor_service.commands.options import add_service_options, settings_of
from dropanchor_service.commands.recorded import recorded
from dropanchor_service.runtime import logs
from dropanchor_service.runtime.signals import interrupts
from dropanchor_service.service import Service
from dropanchor_service.settings.model import PaperSettings, Settings, ZenohSettings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io.session import ZenohError
from dropanchor_tag_client.recording import RecordingError
from dropanchor_tag_client.simulator.live import start_poses, tag_name

DESCRIPTION = """\
Starts the service and simulated tags that drive around one anchor, and prints where to look. The tags run in a
process of their own and send raw ranges and IMU samples like real ones. What an operator could know of them is given
to the service: where they start, and that their IMU looks ahead. With --unknown-start they have to be found. The first
start after an update compiles the estimator, in about a minute. Ctrl-C ends both.
With --engine paper its tuned parameters run unless the settings say otherwise: the published ones are made for sensors
almost without noise.
"""
EPILOG = """\
examples:
  dropanchor demo
  dropanchor demo --unknown-start
  dropanchor demo --recording plaza2
  dropanchor demo --tags 20 --port 8081 --zenoh-listen tcp/127.0.0.1:7448
"""
UNUSABLE = 2
DIED = 1
START_STD_M = 0.1
END_S = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--tags", type=_count, default=6, metavar="N", help="how many tags (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="same seed, same motion (default: %(default)s)")
    parser.add_argument(
        "--recording",
        metavar="NAME",
        help="a real tag instead: plaza1 or plaza2 (needs gtsam: pip install gtsam), or the folder of a recording",
    )
    parser.add_argument(
        "--unknown-start", action="store_true", help="do not say where the tags start: the engine fleet finds them"
    )
    add_service_options(parser)
    parser.set_defaults(log_level="WARNING")


def run(arguments: argparse.Namespace) -> int:
    """0 when it was stopped, 1 when a part of it died, 2 when it could not start."""
    logs.configure(arguments.log_level)
    try:
        with interrupts() as interrupt, _cast(arguments) as cast:
            with interrupt.raising():  # it may have to compile the estimator
                made = Service(cast.settings)
            with made as service, _tags(cast) as tags:
                sys.stdout.write(_where_to_look(service.url))
                sys.stdout.flush()
                # A recording that was played to its end (0) is no failure: the page stays.
                stopped = interrupt.wait(lambda: tags.poll() in (None, 0) and not service.has_died)
    except KeyboardInterrupt:
        return 0
    except (SettingsError, ListenError, ZenohError, RecordingError) as error:
        sys.stderr.write(f"dropanchor demo: {error}\n")
        return UNUSABLE
    if not stopped:
        sys.stderr.write("dropanchor demo: the simulated tags or the service ended by themselves; see the log above\n")
    return 0 if stopped else DIED


@dataclass(frozen=True)
class Cast:
    """Who takes part: settings of the service, and the arguments of `dropanchor-tag` that play the tags."""

    settings: Settings
    tags: list[str]

    def without_starts(self) -> "Cast":
        tags = {name: tag.model_copy(update={"start": None}) for name, tag in self.settings.tags.items()}
        return replace(self, settings=self.settings.model_copy(update={"tags": tags}))


@contextmanager
def _cast(arguments: argparse.Namespace) -> Iterator[Cast]:
    settings = settings_of(arguments)
    if settings.paper == PaperSettings():
        settings = settings.model_copy(update={"paper": PaperSettings(preset="tuned")})
    if arguments.recording is None:
        simulate = ["simulate", "--tags", str(arguments.tags), "--seed", str(arguments.seed)]
        given = _known(arguments.tags, arguments.seed)
        cast = Cast(settings.model_copy(update={"tags": given | dict(settings.tags)}), simulate)
        yield cast.without_starts() if arguments.unknown_start else cast
        return
    with recorded(arguments.recording) as tag:
        cast = Cast(tag.into(settings), ["replay", str(tag.folder), "--tag", tag.name])
        yield cast.without_starts() if arguments.unknown_start else cast


def _known(count: int, seed: int) -> dict[str, TagSettings]:
    """By tag: what an operator could know."""
    return {
        tag_name(index): TagSettings(
            start=StartPose(x=start.x, y=start.y, heading_rad=start.heading_rad, std_m=START_STD_M), mount_angle_rad=0.0
        )
        for index, start in enumerate(start_poses(count, seed))
    }


@contextmanager
def _tags(cast: Cast) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", "dropanchor_tag_client", *cast.tags]
    command += ["--site", cast.settings.site.id, "--connect", _endpoint(cast.settings.zenoh)]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _endpoint(zenoh: ZenohSettings) -> str:
    """Where the tags connect: any address that we listen on is ours on the loopback too."""
    return (zenoh.connect or zenoh.listen)[0].replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")


def _where_to_look(url: str) -> str:
    return f"the page:   {url}/\nthe poses:  curl {url}/api/v1/poses\nCtrl-C ends the demo.\n"


def _count(text: str) -> int:
    count = int(text)
    if count < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return count
