"""The command `dropanchor-tag`."""

import argparse
import logging
import shlex
import signal
import sys
from importlib import import_module
from types import FrameType, ModuleType

from dropanchor_tag_client.options import complete
from dropanchor_tag_client.recording import RecordingError
from dropanchor_tag_client.session import ConnectError

_TEACH = argparse.RawDescriptionHelpFormatter
_EXTRAS = {
    "numpy": ("the simulator needs numpy", "numpy"),
    "serial": ("modules on a serial port need pyserial", "pyserial"),
}
_INTERRUPTED, _TERMINATED = 130, 143

_EXAMPLES = """examples:
  dropanchor-tag simulate                                     tags that drive around the anchor
  dropanchor-tag replay recordings/yard --anchor 1            a recording, in real time
  dropanchor-tag replay recordings/yard --speed 10 --tag cart ten times as fast, as the tag "cart"
  dropanchor-tag serial /dev/ttyACM0 --tag cart               a UWB module on a serial port
  echo '{"anchor": 1, "range_m": 3.21}' | dropanchor-tag publish --tag cart

`dropanchor-tag COMMAND --help` explains each of them.
"""
_REPLAY = """Publishes a recording as if its tag were here, with the original spacing of its samples."""
_REPLAY_EXAMPLES = """examples:
  dropanchor-tag replay recordings/yard --anchor 1 --speed 10
  dropanchor-tag replay recordings/yard --loop --connect tls/router.example:7447 --ca ca.pem

A recording is a folder of CSV files, plain or gzipped: range.csv (t_s, anchor_id, range_m, perhaps std_m),
anchors.csv (id, x, y, z) and, where there are any, imu.csv (t_s, ax, ay, az, gx, gy, gz, perhaps mx, my, mz) and
heading.csv (t_s, yaw_rad, perhaps std_rad).
"""
_PUBLISH = """Reads one JSON object per line from standard input and publishes it: any script can be a tag."""
_PUBLISH_EXAMPLES = """a line is one sample,
  {"anchor": 1, "range_m": 3.21, "std_m": 0.1}
  {"acc": [0, 0, 9.81], "gyro": [0, 0, 0.1], "mag": [0, 20, -44]}
  {"heading_rad": 1.57}
  {"anchor": 1, "bearing_rad": 0.3}
or a samples message as in the protocol:
  {"range": [{"t_ns": 1760000000000000000, "anchor": 1, "range_m": 3.21}]}

Without t_ns the time is that of reading. A bad line is reported with its number and left out; the exit code is then 1.
example:
  my_uwb_reader | dropanchor-tag publish --tag cart
  my_uwb_reader | dropanchor-tag publish --credentials cart/      with the folder that `dropanchor tag add cart` made
"""
_SERIAL = """Publishes what a UWB module on a serial port reports: the module is a tag, or an anchor that hears tags."""
_SERIAL_EXAMPLES = """examples:
  dropanchor-tag serial /dev/ttyACM0 --tag cart-1                       finds out which module it is
  dropanchor-tag serial /dev/ttyACM0 --tag cart-1 --module dwm1001 --name 022E=yard
                                                                        anchor 022E is the site's anchor "yard"
  dropanchor-tag serial /dev/ttyACM0 --tag cart-1 --module dwm3001 --start "INITF -ADDR=0 -PADDR=1"
  dropanchor-tag serial /dev/ttyUSB0 --tag arm-1 --module linktrack --forward=-x --up=y
  dropanchor-tag serial /dev/ttyUSB0 --tag-from-id --tag cart-          the module is the anchor: tags cart-0, cart-1, …

It names the anchors that it hears; the site must know them by these names. It goes on when the module is unplugged and
comes back. What it leaves out, and why, it says at most once per second.
"""
_SIMULATE = """Publishes what the sensors of simulated tags measure while they drive around one anchor."""
_SIMULATE_EXAMPLES = """examples:
  dropanchor-tag simulate --tags 5                              five tags, live, until Ctrl-C
  dropanchor-tag simulate --duration 60 --out recordings/made   a minute of one tag as a recording with its truth
"""


def main(arguments: list[str] | None = None) -> int:
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    signal.signal(signal.SIGTERM, _terminate)
    given = sys.argv[1:] if arguments is None else arguments
    try:
        parsed = parser(given[0] if given else "").parse_args(given)
        complete(parsed)
        return int(_source(parsed.command).run(parsed))
    except KeyboardInterrupt:
        return _INTERRUPTED
    except ModuleNotFoundError as error:
        if error.name not in _EXTRAS:
            raise
        needs, package = _EXTRAS[error.name]
        return _failed(f"{needs}: {shlex.quote(sys.executable)} -m pip install {package}")
    except (ConnectError, RecordingError, ValueError) as error:
        return _failed(str(error))


def parser(command: str) -> argparse.ArgumentParser:
    """The parser of the whole command line, with the options of this one command: no other source is imported."""
    top = argparse.ArgumentParser(
        prog="dropanchor-tag",
        description="Publishes the raw samples of a tag: UWB ranges and IMU.",
        epilog=_EXAMPLES,
        formatter_class=_TEACH,
    )
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, about, examples in (
        ("replay", _REPLAY, _REPLAY_EXAMPLES),
        ("simulate", _SIMULATE, _SIMULATE_EXAMPLES),
        ("publish", _PUBLISH, _PUBLISH_EXAMPLES),
        ("serial", _SERIAL, _SERIAL_EXAMPLES),
    ):
        one = commands.add_parser(name, help=about, description=about, epilog=examples, formatter_class=_TEACH)
        if name == command:
            _source(name).add_arguments(one)
    return top


def _source(command: str) -> ModuleType:
    return import_module(f"dropanchor_tag_client.sources.{command}")


def _failed(why: str) -> int:
    print(f"dropanchor-tag: {why}", file=sys.stderr)
    return 2


def _terminate(_number: int, _frame: FrameType | None) -> None:
    raise SystemExit(_TERMINATED)
