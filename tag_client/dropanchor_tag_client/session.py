"""The Zenoh session of a tag: its endpoint, its credentials, and the options that must not keep their defaults."""

import json
import logging
import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import zenoh

from dropanchor_tag_client.reminders import Reminders

DEFAULT_CONNECT = "tcp/127.0.0.1:7447"
_PROTOCOLS = ("tcp", "tls", "quic", "udp", "ws", "unixsock-stream")
_FIRST_ATTEMPT_S, _ATTEMPT_S = 1.0, 5.0

_log = logging.getLogger(__name__)


class ConnectError(Exception):
    """The router did not answer in time, or it rejected the client. Zenoh does not report which."""


class SessionSettings:
    """How to reach the router. Raises ValueError for settings that cannot work.

    connect: Zenoh endpoint, `tcp/host:port` or `tls/host:port`.
    ca, cert, key: PEM files for TLS. cert and key are needed if the router requires client certificates.
    user, password: needed if the router requires them.
    thin_link: use small send buffers. A link that is too slow for the data then delivers fewer but newer samples.
    """

    def __init__(
        self,
        *,
        connect: str = DEFAULT_CONNECT,
        ca: str | Path | None = None,
        cert: str | Path | None = None,
        key: str | Path | None = None,
        user: str | None = None,
        password: str | None = None,
        thin_link: bool = False,
    ) -> None:
        self.connect, self.thin_link = connect, thin_link
        self.ca, self.cert, self.key = ca, cert, key
        self.user, self.password = user, password
        self._check()

    def _check(self) -> None:
        protocol, slash, address = self.connect.partition("/")
        if protocol not in _PROTOCOLS or not slash or not address:
            raise ValueError(f"connect is {self.connect!r}; an endpoint such as {DEFAULT_CONNECT} was expected")
        if (self.cert is None) != (self.key is None):
            raise ValueError("cert and key go together: give both or neither")
        if (self.user is None) != (self.password is None):
            raise ValueError("user and password go together: give both or neither")
        for name, path in (("ca", self.ca), ("cert", self.cert), ("key", self.key)):
            if path is not None and protocol not in ("tls", "quic"):
                raise ValueError(f"{name} is given, but {self.connect} is not a tls/ or quic/ endpoint")
            if path is not None and not Path(path).is_file():
                raise ValueError(f"{name}: there is no file {path}")


class SharedSession(NamedTuple):
    """A session for many tags, and what it was opened with."""

    session: zenoh.Session
    settings: SessionSettings


def open_session(settings: SessionSettings, timeout_s: float | None = None) -> zenoh.Session:
    """Return a connected session, which reconnects by itself without a limit.

    Try for `timeout_s`, then raise ConnectError. With None, try without a limit, and log a warning ever more rarely.
    """
    deadline_s = math.inf if timeout_s is None else time.monotonic() + timeout_s
    attempt_s, reminders = _FIRST_ATTEMPT_S, Reminders()
    while True:
        left_s = min(attempt_s, deadline_s - time.monotonic())
        try:
            return zenoh.open(zenoh.Config.from_json5(json.dumps(configuration(settings, left_s))))
        except zenoh.ZError as error:
            if time.monotonic() + 0.01 >= deadline_s:
                raise ConnectError(_what_to_check(settings)) from error
        if reminders.failed():
            _log.warning("%s %s.", _what_to_check(settings), reminders.words)
        attempt_s = _ATTEMPT_S
        time.sleep(0.1)  # some settings fail immediately, every time


def configuration(settings: SessionSettings, attempt_s: float = _ATTEMPT_S) -> dict[str, Any]:
    """Return the Zenoh configuration (client mode)."""
    return {
        "mode": "client",
        "connect": {
            "endpoints": [settings.connect],
            # An endless attempt inside Zenoh could not be interrupted. A session from a finite one still reconnects.
            "timeout_ms": max(1, round(attempt_s * 1000)),
            "exit_on_failure": True,
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2},
        },
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "shared_memory": {"enabled": False},
            "link": _link(settings),
            "auth": {"usrpwd": {"user": settings.user, "password": settings.password}} if settings.user else {},
        },
    }


def _link(settings: SessionSettings) -> dict[str, Any]:
    link: dict[str, Any] = {"tx": {"lease": 4000, "keep_alive": 4}, "rx": {"max_message_size": 2**20}}
    if settings.thin_link:
        link["tx"]["batch_size"] = 4096
        link["tcp"] = {"so_sndbuf": 8192}
    if settings.ca is not None or settings.cert is not None:
        link["tls"] = _tls(settings)
    return link


def _tls(settings: SessionSettings) -> dict[str, Any]:
    tls: dict[str, Any] = {"verify_name_on_connect": True, "close_link_on_expiration": True}
    if settings.ca is not None:
        tls["root_ca_certificate"] = str(settings.ca)
    if settings.cert is not None:
        tls |= {
            "enable_mtls": True,
            "connect_certificate": str(settings.cert),
            "connect_private_key": str(settings.key),
        }
    return tls


def _what_to_check(settings: SessionSettings) -> str:
    checks = ["the address", "that the router runs"]
    if settings.connect.startswith(("tls/", "quic/")):
        checks.append("the certificates")
    if settings.user is not None:
        checks.append("user and password")
    else:
        checks.append("whether the router requires a certificate or a password")
    return f"Cannot connect to {settings.connect}: check {', '.join(checks[:-1])} and {checks[-1]}."
