"""The commands of `dropanchor-tag` at the full rates of their sources, each in a process of its own."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import Popen

from support.commands import start_python
from support.module_strings import EXAMPLES
from support.mosquitto import mosquitto
from support.repeated import repeated
from support.serial_module import plugged_in

IMU_HZ, RANGES_HZ = 100, 10

_RULES = """
[[rule]]
topic = "imu/+"
tag = "{1}"
kind = "imu"
fields = { acc = "acc", gyro = "gyro" }

[[rule]]
topic = "uwb/+"
tag = "{1}"
kind = "range"
fields = { anchor = "anchor", range_m = "range_m" }
"""
_IMU_WITH_A_FAKE_CHIP = """
import itertools, sys
from types import ModuleType

class Chip:
    gyro, magnetic = (0.0, 0.0, 0.1), (0.0, 20.0, -40.0)
    def __init__(self, *bus_and_address):
        self._readings = itertools.cycle((0.0, 0.0, 9.81 + 0.001 * i) for i in range(100))
    @property
    def acceleration(self):
        return next(self._readings)

bus, library = ModuleType("adafruit_extended_bus"), ModuleType("adafruit_icm20x")
bus.ExtendedI2C, library.ICM20948 = int, Chip
sys.modules |= {"adafruit_extended_bus": bus, "adafruit_icm20x": library}
from dropanchor_tag_client.cli import main
sys.exit(main(sys.argv[1:]))
"""

Process = Popen[str]


@contextmanager
def serial(module: str, rate_hz: float, folder: Path, endpoint: str) -> Iterator[Process]:
    """Run `serial` at a pseudo-terminal where a module reports at this rate, until the block ends."""
    text, baud = EXAMPLES[module].text, 921_600 if module == "linktrack" else 115_200
    with (
        plugged_in(folder / module, lambda sent: b"" if sent else text(10.0), baud, 1.0 / rate_hz) as port,
        _command("serial", str(port.path), "--tag", "cart", "--module", module, "--connect", endpoint) as process,
    ):
        yield process


@contextmanager
def imu(_folder: Path, endpoint: str) -> Iterator[Process]:
    """Run `imu` with a chip that answers at once, until the block ends."""
    arguments = ("imu", "--device", "icm20948", "--tag", "cart", "--connect", endpoint)
    with _ended(start_python("-c", _IMU_WITH_A_FAKE_CHIP, *arguments)) as process:
        yield process


@contextmanager
def mqtt(folder: Path, endpoint: str) -> Iterator[Process]:
    """Run `mqtt` with a message for each sample, until the block ends."""
    rules = folder / "rules.toml"
    rules.write_text(_RULES)
    with (
        mosquitto(folder) as broker,
        broker.publisher() as client,
        _command("mqtt", f"127.0.0.1:{broker.port}", "--template", str(rules), "--connect", endpoint) as process,
        _samples(lambda sample: client.publish("uwb/cart" if "anchor" in sample else "imu/cart", json.dumps(sample))),
    ):
        yield process


@contextmanager
def publish(_folder: Path, endpoint: str) -> Iterator[Process]:
    """Run `publish` with a line for each sample, until the block ends."""
    with _command("publish", "--tag", "cart", "--connect", endpoint) as process:
        stdin = process.stdin
        assert stdin is not None

        def write(sample: dict[str, object]) -> None:
            stdin.write(json.dumps(sample) + "\n")
            stdin.flush()

        with _samples(write):
            yield process


@contextmanager
def _samples(take: Callable[[dict[str, object]], object]) -> Iterator[None]:
    """Make IMU samples and ranges at their rates, in real time, until the block ends."""

    def take_samples(index: int) -> None:
        take({"acc": [0.0, 0.0, 9.81 + 0.001 * (index % 7)], "gyro": [0.0, 0.0, 0.1]})
        if index % (IMU_HZ // RANGES_HZ) == 0:
            take({"anchor": 7, "range_m": 12.25})

    with repeated(take_samples, 1.0 / IMU_HZ):
        yield


@contextmanager
def _command(*arguments: str) -> Iterator[Process]:
    with _ended(start_python("-m", "dropanchor_tag_client", *arguments)) as process:
        yield process


@contextmanager
def _ended(process: Process) -> Iterator[Process]:
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=30)
