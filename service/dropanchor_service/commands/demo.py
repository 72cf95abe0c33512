"""`dropanchor demo`: run the service with simulated tags and watch them in a browser."""

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from dropanchor_service.api.http.server import ListenError
from dropanchor_service.api.simulated_tags import SimulatedTags, simulated_settings
from dropanchor_service.commands.lan import show_addresses
from dropanchor_service.commands.options import add_service_options, settings_of
from dropanchor_service.commands.recorded import recorded_tag
from dropanchor_service.runtime import logs
from dropanchor_service.runtime.private_files import keep_private
from dropanchor_service.runtime.signals import interrupts
from dropanchor_service.service import Service
from dropanchor_service.settings.model import PaperSettings, Settings, ZenohSettings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io.session import ZenohError
from dropanchor_tag_client.recording import RecordingError

DESCRIPTION = """\
Starts the service and simulated tags that drive around one anchor, and prints the address of the page. The tags run in
a separate process and send raw ranges and IMU samples, like real ones. The service gets what an operator would know:
the start of each tag, and that its IMU points ahead. With --unknown-start the service has to find the start itself.
The first start after an update compiles the estimator, which takes half a minute or more. Ctrl-C stops the demo.
The engine paper runs with its tuned parameters unless the settings say otherwise, because the published parameters are
for sensors almost without noise.
"""
EPILOG = """\
examples:
  dropanchor demo
  dropanchor demo --unknown-start
  dropanchor demo --recording plaza2
  dropanchor demo --tags 20 --port 8081 --zenoh-listen tcp/127.0.0.1:7448
"""
REFUSED = (SettingsError, ListenError, ZenohError, RecordingError)
EXIT_DIED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--tags", type=_count, default=6, metavar="N", help="number of tags (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the motion (default: %(default)s)")
    parser.add_argument(
        "--recording",
        metavar="NAME",
        help="replay a real tag: plaza1 or plaza2 (needs gtsam: pip install gtsam), or the folder of a recording",
    )
    parser.add_argument(
        "--unknown-start", action="store_true", help="do not configure the start; the engine fleet finds it"
    )
    add_service_options(parser)
    parser.set_defaults(log_level="WARNING")


def run(arguments: argparse.Namespace) -> int:
    """Run the demo. Return 0 if it was stopped, 1 if a part of it died. Raises REFUSED if it cannot start."""
    logs.configure(arguments.log_level)
    try:
        with (
            interrupts() as interrupt,
            _demo_setup(arguments) as setup,
            Service(setup.settings, compiling=interrupt.raising()) as service,
            SimulatedTags() as tags,
        ):
            tags.start(_tag_words(setup))
            sys.stdout.write(_addresses(service.url))
            show_addresses(service.url, sys.stdout)
            sys.stdout.flush()
            # A recording that ended normally (exit code 0) is no failure: the page stays available.
            stopped = interrupt.wait(lambda: tags.poll() in (None, 0) and not service.has_died)
    except KeyboardInterrupt:
        return 0
    if not stopped:
        sys.stderr.write("dropanchor demo: the simulated tags or the service ended by themselves; see the log above\n")
    return 0 if stopped else EXIT_DIED


@dataclass(frozen=True)
class DemoSetup:
    """The settings of the service, and the arguments of `dropanchor-tag` for the tags."""

    settings: Settings
    tag_arguments: list[str]

    def without_starts(self) -> "DemoSetup":
        """Return the setup without the start poses of the tags."""
        tags = {name: tag.model_copy(update={"start": None}) for name, tag in self.settings.tags.items()}
        return replace(self, settings=self.settings.model_copy(update={"tags": tags}))


@contextmanager
def _demo_setup(arguments: argparse.Namespace) -> Iterator[DemoSetup]:
    settings = settings_of(arguments)
    keep_private(settings.data_dir)
    if settings.sites:
        raise SettingsError("the demo has one site: leave out [sites], or use dropanchor serve")
    if settings.paper == PaperSettings():
        settings = settings.model_copy(update={"paper": PaperSettings(preset="tuned")})
    if arguments.recording is None:
        simulate = ["simulate", "--until-input-ends", "--tags", str(arguments.tags), "--seed", str(arguments.seed)]
        tags = simulated_settings(arguments.tags, arguments.seed)
        setup = DemoSetup(settings.model_copy(update={"tags": tags | dict(settings.tags)}), simulate)
        yield setup.without_starts() if arguments.unknown_start else setup
        return
    with recorded_tag(arguments.recording) as tag:
        setup = DemoSetup(tag.add_to(settings), ["replay", str(tag.folder), "--tag", tag.name])
        yield setup.without_starts() if arguments.unknown_start else setup


def _tag_words(setup: DemoSetup) -> list[str]:
    """Return the arguments of `dropanchor-tag`."""
    return [*setup.tag_arguments, "--site", setup.settings.site.id, "--connect", _endpoint(setup.settings.zenoh)]


def _endpoint(zenoh: ZenohSettings) -> str:
    """Return the endpoint for the tags. A wildcard address becomes the loopback address."""
    return (zenoh.connect or zenoh.listen)[0].replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")


def _addresses(url: str) -> str:
    return f"the page:   {url}/\nthe poses:  curl {url}/api/v1/poses\nCtrl-C ends the demo.\n"


def _count(text: str) -> int:
    count = int(text)
    if count < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return count
