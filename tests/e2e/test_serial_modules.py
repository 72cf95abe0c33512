"""UWB modules on serial ports become dots that move: module, Zenoh, service, REST. Where a module has no IMU, another
program publishes one for the same tag."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from math import hypot
from pathlib import Path

from dropanchor_tag_client import TagClient
from dropanchor_tag_client.sources.modules.catalogue import MODULES
from support.commands import start_python
from support.module_strings import EXAMPLES
from support.patience import PATIENCE_S
from support.repeated import repeated
from support.serial_module import Answer, plugged_in
from support.service import running_service, settings_file
from support.vibration import shaken_acc, shaken_gyro
from support.zenoh_router import wait_until

SPEED_MPS = 1.0


@contextmanager
def imu_of_others(endpoint: str) -> Iterator[None]:
    """Publish IMU samples of a tag that moves north for each module without an IMU, until the block ends."""
    with ExitStack() as stack:
        clients = [
            stack.enter_context(TagClient(tag, connect=endpoint))
            for tag, example in EXAMPLES.items()
            if not example.has_imu
        ]

        def publish(_: int) -> None:
            for client in clients:
                client.publish_imu(shaken_acc(), shaken_gyro(), (20.0, 0.0, -40.0))

        with repeated(publish, 0.02):
            yield


def distance(began_s: float) -> float:
    return hypot(10.0, -20.0 + SPEED_MPS * (time.monotonic() - began_s))


def moving(text: Callable[[float], bytes], began_s: float) -> Answer:
    """Return the answers of a module that moves north from (10, -20) past the anchor."""
    return lambda sent: b"" if sent else text(distance(began_s))


def is_on_its_range(x: float, y: float, began_s: float) -> bool:
    return abs(hypot(x, y) - distance(began_s)) < 0.5 and time.monotonic() - began_s > 8.0


def test_each_module_is_a_dot_that_moves_along_its_ranges(tmp_path: Path) -> None:
    config = settings_file(tmp_path, list(EXAMPLES))
    with running_service("--config", str(config)) as service, ExitStack() as stack:
        began_s = time.monotonic()
        for name, example in EXAMPLES.items():
            answer, baud = moving(example.text, began_s), MODULES[name].baud
            module = stack.enter_context(plugged_in(tmp_path / name, answer, baud, period_s=0.1))
            arguments = ("--tag", name, "--module", name, "--connect", service.zenoh, *example.options)
            process = start_python("-m", "dropanchor_tag_client", "serial", str(module.path), *arguments)
            stack.callback(process.communicate, timeout=PATIENCE_S)
            stack.callback(process.terminate)
        stack.enter_context(imu_of_others(service.zenoh))

        def poses() -> dict[str, tuple[float, float]]:
            return {
                pose["tag"]: (pose["x"], pose["y"])
                for pose in service.get("/api/v1/poses")["poses"]
                if pose["x"] is not None
            }

        wait_until(lambda: set(poses()) == set(EXAMPLES))
        first = poses()

        def follows_its_ranges(tag: str, x: float, y: float) -> bool:
            return is_on_its_range(x, y, began_s) and hypot(x - first[tag][0], y - first[tag][1]) > 1.0

        wait_until(lambda: all(follows_its_ranges(tag, *place) for tag, place in poses().items()))
