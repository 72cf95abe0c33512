"""The connection options of all subcommands, and the clients and sessions built from them."""

import argparse
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from dropanchor_tag_client.calibration import Calibration, CalibrationError, read_calibration
from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.credentials import read_credentials
from dropanchor_tag_client.health import HealthValues
from dropanchor_tag_client.host import host_health, program
from dropanchor_tag_client.reception import WHAT_TO_CHECK, Reception
from dropanchor_tag_client.session import DEFAULT_CONNECT, SessionSettings, SharedSession, open_session
from dropanchor_tag_client.upkeep import Upkeep

PASSWORD_VARIABLE = "DROPANCHOR_PASSWORD"


def add_connection_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("connection")
    group.add_argument(
        "--credentials",
        metavar="FOLDER",
        help="folder from `dropanchor tag add`: certificates, and defaults for --tag, --site and --connect",
    )
    group.add_argument("--site", help="site that the tag belongs to (default: default)")
    group.add_argument(
        "--connect",
        metavar="ENDPOINT",
        help=f"Zenoh router: tcp/host:port or tls/host:port (default: {DEFAULT_CONNECT})",
    )
    group.add_argument("--encoding", choices=["packed", "json"], default="packed", help="default: %(default)s")
    group.add_argument(
        "--ca", metavar="PEM", help="certificate of the authority that signed the router's certificate (tls/)"
    )
    group.add_argument("--cert", metavar="PEM", help="client certificate, if the router requires one")
    group.add_argument("--key", metavar="PEM", help="private key of --cert")
    group.add_argument(
        "--user", help=f"user name; the password comes from the environment variable {PASSWORD_VARIABLE}"
    )
    group.add_argument(
        "--connect-timeout",
        type=float,
        metavar="S",
        help="give up after S seconds without an answer from the router (default: try without a limit)",
    )


def add_spool_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("outages")
    group.add_argument(
        "--spool",
        metavar="FOLDER",
        help="keep the samples of long outages on disk, and send them afterwards, even after a restart",
    )
    group.add_argument(
        "--spool-limit",
        type=float,
        default=100.0,
        metavar="MB",
        help="delete the oldest samples when the spool of a tag is larger (default: %(default)g)",
    )


def spool_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the spool settings of a TagClient."""
    if "spool" not in arguments or arguments.spool is None:
        return {}
    return {"spool": arguments.spool, "spool_limit_bytes": round(arguments.spool_limit * 1_000_000)}


def add_calibration_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--calibration",
        metavar="FOLDER",
        help="folder of the IMU's calibration, from `dropanchor-tag calibrate` (default: the one of --credentials)",
    )


def calibration(arguments: argparse.Namespace) -> Calibration | None:
    """Return the calibration of the tag's IMU, if the program uses one. Raises CalibrationError."""
    if "calibration" not in arguments:
        return None
    folder = arguments.calibration or arguments.credentials
    found = None if folder is None else read_calibration(folder)
    if found is None and arguments.calibration is not None:
        raise CalibrationError(f"{folder} holds no calibration: `dropanchor-tag calibrate {folder}` makes one")
    return found


def add_anchor_name_option(parser: argparse.ArgumentParser, source: str) -> None:
    """Add --name. source: who calls anchors by ids of its own, such as "the module calls"."""
    parser.add_argument(
        "--name",
        action="append",
        default=[],
        metavar="ID=NAME",
        help=f"the site's NAME of the anchor that {source} ID; may be given several times",
    )


def anchor_names(arguments: argparse.Namespace) -> dict[str, str]:
    """Return the site's names of anchors, by the ids that a module or a message gives them. Raises ValueError."""
    return dict(_anchor_name(text) for text in arguments.name)


def _anchor_name(text: str) -> tuple[str, str]:
    called, equals, name = text.partition("=")
    if not called or not equals or not name:
        raise ValueError(f"--name {text}: ID=NAME was expected, such as 022E=yard")
    return called, name


def apply_defaults(arguments: argparse.Namespace) -> None:
    """Fill in missing options from the credentials folder, then from the defaults. Raises ValueError."""
    if arguments.credentials is not None:
        given = read_credentials(arguments.credentials, arguments.connect)
        arguments.site = arguments.site or given.site
        arguments.connect = given.session.connect
        arguments.ca, arguments.cert, arguments.key = given.session.ca, given.session.cert, given.session.key
        if "tag" in arguments:
            arguments.tag = arguments.tag or given.tag
    arguments.site = arguments.site or "default"
    arguments.connect = arguments.connect or DEFAULT_CONNECT


def session_settings(arguments: argparse.Namespace) -> SessionSettings:
    """Return the session settings of the options. Raises ValueError if options contradict each other."""
    password = os.environ.get(PASSWORD_VARIABLE) if arguments.user else None
    if arguments.user and password is None:
        raise ValueError(f"--user needs a password: set the environment variable {PASSWORD_VARIABLE}")
    return SessionSettings(
        connect=arguments.connect,
        ca=arguments.ca,
        cert=arguments.cert,
        key=arguments.key,
        user=arguments.user,
        password=password,
    )


@contextmanager
def opened_client(arguments: argparse.Namespace, tag: str, **settings: Any) -> Iterator[TagClient]:
    """Open the client of a tag for the duration of the `with` block, and report its health meanwhile.

    The tag is the machine that this program runs on, unless it replays. Ctrl-C while it connects exits immediately.
    """
    client = TagClient(
        tag,
        site=arguments.site,
        connect=session_settings(arguments),
        encoding=arguments.encoding,
        connect_timeout_s=arguments.connect_timeout,
        calibration=calibration(arguments),
        **spool_settings(arguments),
        **settings,
    )
    with _interruptible():
        client.open()
    health = partial(_health, settings.get("replay", False))
    try:
        with Upkeep([client], health):
            yield client
    finally:
        client.close()


def _health(replay: bool) -> HealthValues:
    values = HealthValues() if replay else host_health()
    values["firmware"] = program()
    return values


def is_received(client: TagClient) -> bool:
    """Say so if nobody receives the samples of an open client that has no spool, and return whether somebody does."""
    if client.session is None or client.spool_counts is not None:
        return True
    reception = Reception(client.session, client.keys.samples)
    try:
        received = reception.wait()
    finally:
        reception.close()
    if not received:
        sys.stderr.write(f"nobody receives the samples of {client.tag}: {WHAT_TO_CHECK}\n")
    return received


@contextmanager
def opened_session(arguments: argparse.Namespace) -> Iterator[SharedSession]:
    """Open one session for many tags. Ctrl-C while it connects exits immediately."""
    settings = session_settings(arguments)
    with _interruptible():
        session = open_session(settings, arguments.connect_timeout)
    try:
        yield SharedSession(session, settings)
    finally:
        session.close()


@contextmanager
def _interruptible() -> Iterator[None]:
    """Restore the default signal handlers while connecting.

    Python runs its own handlers only between bytecodes, and a connection attempt is one long native call.
    """
    before = {number: signal.signal(number, signal.SIG_DFL) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
