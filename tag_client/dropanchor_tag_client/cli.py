"""The command `dropanchor-tag`."""

import argparse
import logging
import shlex
import signal
import sys
from importlib import import_module
from types import FrameType, ModuleType

from dropanchor_tag_client.command_line import (
    COMPLETION,
    LOG_LEVELS,
    Parser,
    add_completion_arguments,
    completion_script,
)
from dropanchor_tag_client.host import program
from dropanchor_tag_client.options import apply_defaults
from dropanchor_tag_client.session import ConnectError

_PROGRAM = "dropanchor-tag"
_ADAFRUIT = (
    "IMUs on I2C need Adafruit's libraries",
    "adafruit-extended-bus adafruit-circuitpython-bno055 adafruit-circuitpython-bno08x adafruit-circuitpython-icm20x",
)
_EXTRAS = {
    "numpy": ("this command needs numpy", "numpy"),
    "serial": ("modules on a serial port need pyserial", "pyserial"),
    "adafruit_extended_bus": _ADAFRUIT,
    "adafruit_bno055": _ADAFRUIT,
    "adafruit_bno08x": _ADAFRUIT,
    "adafruit_icm20x": _ADAFRUIT,
    "paho": ("MQTT needs paho-mqtt", "paho-mqtt"),
    "shtab": ("completion needs shtab", "shtab"),
}
_INTERRUPTED, _TERMINATED = 130, 143

_EXAMPLES = """examples:
  dropanchor-tag simulate                                     tags that drive around the anchor
  dropanchor-tag replay recordings/yard --anchor 1            a recording, in real time
  dropanchor-tag replay recordings/yard --speed 10 --tag cart ten times as fast, as the tag "cart"
  dropanchor-tag serial /dev/ttyACM0 --tag cart               a UWB module on a serial port
  dropanchor-tag mqtt mqtts://broker:8883 --sensor-logger sensor-logger/+
                                                              phones and others that publish over MQTT
  echo '{"anchor": 1, "range_m": 3.21}' | dropanchor-tag publish --tag cart

`dropanchor-tag COMMAND --help` explains each of them.
"""
_REPLAY = """Publishes a recording like a live tag, with the original spacing of its samples."""
_REPLAY_EXAMPLES = """examples:
  dropanchor-tag replay recordings/yard --anchor 1 --speed 10
  dropanchor-tag replay recordings/yard --loop --connect tls/router.example:7447 --ca ca.pem

A recording is a folder of CSV files, plain or gzipped: range.csv (t_s, anchor_id, range_m, optional std_m) and
anchors.csv (id, x, y, z). Optional files are imu.csv (t_s, ax, ay, az, gx, gy, gz, optional mx, my, mz) and
heading.csv (t_s, yaw_rad, optional std_rad).
"""
_PUBLISH = """Reads JSON objects from standard input, one per line, and publishes them: any script can be a tag."""
_PUBLISH_EXAMPLES = """a line is one sample:
  {"anchor": 1, "range_m": 3.21, "std_m": 0.1}
  {"acc": [0, 0, 9.81], "gyro": [0, 0, 0.1], "mag": [0, 20, -44]}
  {"heading_rad": 1.57}
  {"anchor": 1, "bearing_rad": 0.3}
  {"pressure_pa": 101325.0}
or says something about the tag:
  {"battery_fraction": 0.83, "battery_v": 3.9, "temperature_c": 24.5, "rssi_dbm": -61, "firmware": "1.4.2"}
or a samples message of the protocol:
  {"range": [{"t_ns": 1760000000000000000, "anchor": 1, "range_m": 3.21}]}

Without t_ns, a sample gets the time at which its line is read. A bad line is reported with its number and skipped; the
exit code is then 1, as it is when nobody receives the samples.
examples:
  my_uwb_reader | dropanchor-tag publish --tag cart
  my_uwb_reader | dropanchor-tag publish --credentials cart/      with the folder from `dropanchor tag add cart`
"""
_SERIAL = """Publishes the measurements of a UWB module on a serial port: a tag, or an anchor that ranges to tags."""
_SERIAL_EXAMPLES = """examples:
  dropanchor-tag serial /dev/ttyACM0 --tag cart-1                       detects the type of the module
  dropanchor-tag serial /dev/ttyACM0 --tag cart-1 --module dwm1001 --name 022E=yard
                                                                        anchor 022E is the site's anchor "yard"
  dropanchor-tag serial /dev/ttyACM0 --tag cart-1 --module dwm3001 --start "INITF -ADDR=0 -PADDR=1"
  dropanchor-tag serial /dev/ttyUSB0 --tag arm-1 --module linktrack --forward=-x --up=y
  dropanchor-tag serial /dev/ttyUSB0 --tag arm-1 --pattern 'from: {anchor} Range: {range:m} m'
                                                                        any module that prints lines
  dropanchor-tag serial /dev/ttyUSB0 --tag-from-id --tag cart-          the module is the anchor: tags cart-0, cart-1, …

The command prints the ids of the anchors; configure them in the site under these names. It continues when the module is
unplugged and plugged in again. It reports rejected data, with the reason, at most once per second.
"""
_MQTT = """Publishes the measurements in the messages of an MQTT broker."""
_MQTT_EXAMPLES = """examples:
  dropanchor-tag mqtt mqtt://gateway --decawave --name 022E=yard           tags behind a Decawave or LEAPS gateway
  dropanchor-tag mqtt wss://broker:8884 --sensor-logger sensor-logger/+    phones with the app Sensor Logger
  dropanchor-tag mqtt broker --template rules.toml                         anything that sends JSON

rules.toml, for {"device": 7, "anchors": [{"id": "yard", "cm": 321}]} on plant/a/uwb:
  [[rule]]
  topic = "plant/+/uwb"
  tag = "{1}-{device}"
  kind = "range"
  each = "anchors"
  fields = { anchor = "id", range_m = "cm" }
  scale = { range_m = 0.01 }

It reports what it leaves out, with the reason, at most once per second.
"""
_IMU = """Publishes the samples of an IMU chip on I2C."""
_IMU_EXAMPLES = """examples:
  dropanchor-tag imu --device bno085 --self-test                find out how the chip is mounted
  dropanchor-tag imu --device bno085 --tag cart-1 --forward=-y  its axis -y points forward
  dropanchor-tag imu --device icm20948 --credentials cart-1/    with the folder's calibration, if it has one
"""
_CALIBRATE = (
    """Measures the errors of an IMU and writes them into the folder of its tag, where the other commands find them."""
)
_CALIBRATE_EXAMPLES = """examples:
  dropanchor-tag calibrate cart-1/ --device bno085 --forward=-y
  my_imu_reader | dropanchor-tag calibrate cart-1/              lines as for publish, x forward, y left, z up

Leave the tag alone for a few seconds: that gives the bias of the gyroscope and the scale of the accelerometer. Then
turn it through full circles, and swing it in figures of eight, away from iron and motors: that gives the hard and soft
iron of the magnetometer. A vehicle need only turn. The IMU must be where it will stay in the vehicle.
"""
_INSTALL = (
    """Makes a systemd unit of a command, which then runs from the start of the machine and after every failure."""
)
_INSTALL_EXAMPLES = """examples:
  dropanchor-tag install serial /dev/ttyACM0 --tag cart-1 --spool spool     prints the unit
  dropanchor-tag install --user imu --device bno085 --credentials cart-1    writes it for this user

Passwords belong into /etc/dropanchor/tag.env, or ~/.config/dropanchor/tag.env with --user: DROPANCHOR_PASSWORD=…
"""
_SIMULATE = """Publishes the samples of simulated tags that drive around one anchor."""
_SIMULATE_EXAMPLES = """examples:
  dropanchor-tag simulate --tags 5                              five tags, live, until Ctrl-C
  dropanchor-tag simulate --duration 60 --out recordings/made   a minute of one tag as a recording with its truth
"""


_COMMANDS = {
    "replay": (_REPLAY, _REPLAY_EXAMPLES),
    "simulate": (_SIMULATE, _SIMULATE_EXAMPLES),
    "publish": (_PUBLISH, _PUBLISH_EXAMPLES),
    "serial": (_SERIAL, _SERIAL_EXAMPLES),
    "mqtt": (_MQTT, _MQTT_EXAMPLES),
    "imu": (_IMU, _IMU_EXAMPLES),
    "calibrate": (_CALIBRATE, _CALIBRATE_EXAMPLES),
    "install": (_INSTALL, _INSTALL_EXAMPLES),
}


def main(arguments: list[str] | None = None) -> int:
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    signal.signal(signal.SIGTERM, _terminate)
    given = sys.argv[1:] if arguments is None else arguments
    try:
        return _run(parser(*given[:1]).parse_args(given))
    except KeyboardInterrupt:
        return _INTERRUPTED
    except ModuleNotFoundError as error:
        if error.name not in _EXTRAS:
            raise
        needs, package = _EXTRAS[error.name]
        return _failed(f"{needs}: {shlex.quote(sys.executable)} -m pip install {package}")
    except (ConnectError, ValueError) as error:
        return _failed(str(error))


def _run(parsed: argparse.Namespace) -> int:
    if parsed.command == "completion":
        print(completion_script(parser(*_COMMANDS), parsed.shell))
        return 0
    logging.getLogger().setLevel(parsed.log_level)
    apply_defaults(parsed)
    return int(_source(parsed.command).run(parsed))


def parser(*commands: str) -> argparse.ArgumentParser:
    """Return the parser of the whole command line. Only these commands get their options and have to be imported."""
    top = Parser(prog=_PROGRAM, description="Publishes the raw samples of a tag: UWB ranges and IMU.", epilog=_EXAMPLES)
    top.add_argument("--version", action="version", version=program())
    actions = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (summary, examples) in _COMMANDS.items():
        one = actions.add_parser(name, help=summary, description=summary, epilog=examples)
        if name in commands:
            one.add_argument(
                "--log-level", default="INFO", choices=LOG_LEVELS, help="least severity to report (default: INFO)"
            )
            _source(name).add_arguments(one)
    add_completion_arguments(actions.add_parser("completion", help=COMPLETION), _PROGRAM)
    return top


def _source(command: str) -> ModuleType:
    return import_module(f"dropanchor_tag_client.sources.{command}")


def _failed(why: str) -> int:
    print(f"dropanchor-tag: {why}", file=sys.stderr)
    return 2


def _terminate(_number: int, _frame: FrameType | None) -> None:
    raise SystemExit(_TERMINATED)
