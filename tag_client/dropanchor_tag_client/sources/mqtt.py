"""Messages of an MQTT broker become samples: of Decawave's gateways, of phones, of anything by a template."""

import argparse
import os
import sys
import time
from pathlib import Path

from dropanchor_tag_client.options import (
    add_anchor_name_option,
    add_connection_options,
    add_spool_options,
    anchor_names,
    opened_session,
    spool_settings,
)
from dropanchor_tag_client.sources.bridge.broker import Broker, BrokerSettings
from dropanchor_tag_client.sources.bridge.decawave import Decawave
from dropanchor_tag_client.sources.bridge.measurement import Format
from dropanchor_tag_client.sources.bridge.pipe import Bridge
from dropanchor_tag_client.sources.bridge.sensor_logger import SensorLogger
from dropanchor_tag_client.sources.bridge.template import Template
from dropanchor_tag_client.sources.bridge.topics import is_filter
from dropanchor_tag_client.sources.phones.pairing import Signs
from dropanchor_tag_client.sources.throttled_log import throttled_log
from dropanchor_tag_client.upkeep import Upkeep

PASSWORD_VARIABLE = "DROPANCHOR_MQTT_PASSWORD"
_FLUSH_S, _POLL_S = 0.1, 0.02


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("broker", metavar="BROKER", help="mqtt://host:1883, mqtts://host:8883, ws:// or wss://")
    what = parser.add_argument_group("what to read, at least one of")
    what.add_argument("--decawave", action="store_true", help="dwm/node/+/uplink/# of a Decawave or LEAPS gateway")
    what.add_argument(
        "--sensor-logger",
        metavar="TOPIC",
        help="the topic that is set in the app Sensor Logger; a + in it is the tag: sensor-logger/+",
    )
    what.add_argument(
        "--signs",
        choices=list(Signs),
        default=Signs.AUTO,
        type=Signs,
        help="which way accelerations of Sensor Logger point (default: gravity tells while the screen is up)",
    )
    what.add_argument("--template", type=Path, action="append", default=[], metavar="FILE", help="rules in TOML")
    parser.add_argument("--tag-prefix", default="", help="what to put before the ids of the tags, such as cart-")
    add_anchor_name_option(parser, "the messages call")
    broker = parser.add_argument_group("broker")
    broker.add_argument("--mqtt-user", help=f"user name; the password comes from the variable {PASSWORD_VARIABLE}")
    broker.add_argument("--mqtt-ca", metavar="PEM", help="authority that signed the broker's certificate")
    broker.add_argument("--mqtt-cert", metavar="PEM", help="client certificate, if the broker requires one")
    broker.add_argument("--mqtt-key", metavar="PEM", help="private key of --mqtt-cert")
    add_connection_options(parser)
    add_spool_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Raises BrokerError, TemplateError, ConnectError, ValueError. Runs until it is interrupted."""
    formats, names = _formats(arguments), anchor_names(arguments)
    topics = tuple(topic for one in formats for topic in one.topics)
    broker = Broker(_settings(arguments), topics, throttled_log())
    with opened_session(arguments) as session:
        options = {"site": arguments.site, "connect": session, "encoding": arguments.encoding, "batch_s": None}
        bridge = Bridge(formats, options | spool_settings(arguments), arguments.tag_prefix, names)
        try:
            with broker.connected(), Upkeep(bridge.clients):
                forward(broker, bridge)
        finally:
            bridge.close()
            sys.stderr.write(f"{bridge.summary()}\n")
    return 0


def forward(broker: Broker, bridge: Bridge) -> None:
    """Publish the measurements of every message until the program is interrupted."""
    flush_s = 0.0
    while True:
        message = broker.receive()
        if message is not None:
            bridge.take(message)
        else:
            time.sleep(_POLL_S)  # then all that came is taken at once: a wake-up for each message costs more
        if time.monotonic() >= flush_s:
            flush_s = time.monotonic() + _FLUSH_S
            bridge.flush()
            bridge.count_lost(broker.lost)
            bridge.log_dropped()


def _formats(arguments: argparse.Namespace) -> list[Format]:
    formats: list[Format] = [Template(path) for path in arguments.template]
    if arguments.decawave:
        formats.append(Decawave())
    if arguments.sensor_logger is not None:
        if not is_filter(arguments.sensor_logger):
            raise ValueError(f"--sensor-logger is {arguments.sensor_logger!r}; a topic such as phones/+ was expected")
        formats.append(SensorLogger(arguments.sensor_logger, arguments.signs))
    if not formats:
        raise ValueError("no format was given: add --decawave, --sensor-logger TOPIC or --template FILE")
    return formats


def _settings(arguments: argparse.Namespace) -> BrokerSettings:
    password = os.environ.get(PASSWORD_VARIABLE) if arguments.mqtt_user else None
    if arguments.mqtt_user and password is None:
        raise ValueError(f"--mqtt-user needs a password: set the environment variable {PASSWORD_VARIABLE}")
    return BrokerSettings(
        arguments.broker, arguments.mqtt_user, password, arguments.mqtt_ca, arguments.mqtt_cert, arguments.mqtt_key
    )
