"""Command-line options that every source shares, and what is built from them."""

import argparse
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import zenoh

from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.credentials import read_credentials
from dropanchor_tag_client.session import DEFAULT_CONNECT, SessionSettings, open_session

PASSWORD_VARIABLE = "DROPANCHOR_PASSWORD"


def add_connection_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("connection")
    group.add_argument(
        "--credentials",
        metavar="FOLDER",
        help="what `dropanchor tag add` made for the tag: certificates, and defaults for --tag, --site and --connect",
    )
    group.add_argument("--site", help="site that the tag belongs to (default: default)")
    group.add_argument(
        "--connect",
        metavar="ENDPOINT",
        help=f"Zenoh router: tcp/host:port or tls/host:port (default: {DEFAULT_CONNECT})",
    )
    group.add_argument("--encoding", choices=["packed", "json"], default="packed", help="default: %(default)s")
    group.add_argument("--ca", metavar="PEM", help="certificate of the authority that signed the router's (tls/)")
    group.add_argument("--cert", metavar="PEM", help="own certificate, where the router asks for one")
    group.add_argument("--key", metavar="PEM", help="private key of --cert")
    group.add_argument("--user", help=f"user name; the password is taken from the environment, {PASSWORD_VARIABLE}")
    group.add_argument(
        "--connect-timeout",
        type=float,
        metavar="S",
        help="give up when the router has not answered for so long (default: try for ever)",
    )


def complete(arguments: argparse.Namespace) -> None:
    """Fills in what was not given: from the credentials, else the defaults. Raises ValueError."""
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
    """Raises ValueError for options that do not go together."""
    password = os.environ.get(PASSWORD_VARIABLE) if arguments.user else None
    if arguments.user and password is None:
        raise ValueError(f"--user is given; put the password into the environment variable {PASSWORD_VARIABLE}")
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
    """The client of a tag with the common options, open inside the `with`. Ctrl-C while it connects ends at once."""
    client = TagClient(
        tag,
        site=arguments.site,
        connect=session_settings(arguments),
        encoding=arguments.encoding,
        connect_timeout_s=arguments.connect_timeout,
        **settings,
    )
    with _interruptible():
        client.open()
    try:
        yield client
    finally:
        client.close()


@contextmanager
def opened_session(arguments: argparse.Namespace) -> Iterator[zenoh.Session]:
    """One session for many tags, with the common options. Ctrl-C while it connects ends at once."""
    with _interruptible():
        session = open_session(session_settings(arguments), arguments.connect_timeout)
    try:
        yield session
    finally:
        session.close()


@contextmanager
def _interruptible() -> Iterator[None]:
    """Python looks at signals only between its own steps; an attempt to connect is one long step."""
    before = {number: signal.signal(number, signal.SIG_DFL) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
