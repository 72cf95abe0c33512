"""UWB modules on serial ports become dots that move: module, Zenoh, service, REST. Where a module has no IMU, another
program publishes one for the same tag."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from math import hypot
from pathlib import Path
from typing import Any

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


def distance(after_s: float) -> float:
    return hypot(10.0, -20.0 + SPEED_MPS * after_s)


def moving(text: Callable[[float], bytes], began_s: float) -> Answer:
    """Return the answers of a module that moves north from (10, -20) past the anchor."""
    return lambda sent: b"" if sent else text(distance(time.time() - began_s))


def is_on_its_range(pose: dict[str, Any], began_s: float) -> bool:
    after_s = pose["t_ns"] * 1e-9 - began_s
    return after_s > 8.0 and abs(hypot(pose["x"], pose["y"]) - distance(after_s)) < 0.5


def test_each_module_is_a_dot_that_moves_along_its_ranges(tmp_path: Path) -> None:
    config = settings_file(tmp_path, list(EXAMPLES))
    with running_service("--config", str(config)) as service, ExitStack() as stack:
        began_s = time.time()
        for name, example in EXAMPLES.items():
            answer, baud = moving(example.text, began_s), MODULES[name].baud
            module = stack.enter_context(plugged_in(tmp_path / name, answer, baud, period_s=0.1))
            arguments = ("--tag", name, "--module", name, "--connect", service.zenoh, *example.options)
            process = start_python("-m", "dropanchor_tag_client", "serial", str(module.path), *arguments)
            stack.callback(process.communicate, timeout=PATIENCE_S)
            stack.callback(process.terminate)
        stack.enter_context(imu_of_others(service.zenoh))

        def poses() -> dict[str, dict[str, Any]]:
            return {pose["tag"]: pose for pose in service.get("/api/v1/poses")["poses"] if pose["x"] is not None}

        wait_until(lambda: set(poses()) == set(EXAMPLES))
        first = poses()

        def follows_its_ranges(pose: dict[str, Any]) -> bool:
            moved_m = hypot(*(pose[axis] - first[pose["tag"]][axis] for axis in "xy"))
            return is_on_its_range(pose, began_s) and moved_m > 1.0

        wait_until(lambda: all(map(follows_its_ranges, poses().values())))
