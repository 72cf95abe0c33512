"""The Zenoh session of the service: a router of its own, or a client of one; with what not to leave at its default."""

import json
from pathlib import Path
from typing import Any

import zenoh

from dropanchor_service.settings import ZenohSettings

ATTEMPT_S = 1.0


class ZenohError(Exception):
    """The session could not be opened; the message says what to check."""


def open_session(settings: ZenohSettings) -> zenoh.Session:
    """Raises ZenohError."""
    try:
        return zenoh.open(_config(settings))
    except zenoh.ZError as error:
        raise ZenohError(_sentence(settings, str(error))) from error


def configuration(settings: ZenohSettings) -> dict[str, Any]:
    """The Zenoh configuration of these endpoints, unless a file gives one."""
    role = _client(settings) if settings.connect else _router(settings)
    return role | {"scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}}}


def _router(settings: ZenohSettings) -> dict[str, Any]:
    return {
        "mode": "router",
        "listen": {"endpoints": list(settings.listen)},
        "transport": {
            "shared_memory": {"enabled": False},
            # Silent sockets, which send nothing after they connect, must not keep tags out.
            "unicast": {"max_sessions": 20_000, "accept_pending": 2000, "accept_timeout": 2000},
            "link": _link(),
        },
    }


def _client(settings: ZenohSettings) -> dict[str, Any]:
    return {
        "mode": "client",
        "connect": {
            "endpoints": list(settings.connect),
            # An endless attempt inside Zenoh could not be interrupted; a finite one still reconnects for ever.
            "timeout_ms": round(ATTEMPT_S * 1000),
            "exit_on_failure": True,
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2},
        },
        "transport": {"shared_memory": {"enabled": False}, "link": _link()},
    }


def _link() -> dict[str, Any]:
    return {"tx": {"lease": 4000, "keep_alive": 4}, "rx": {"max_message_size": 2**20}}


def _config(settings: ZenohSettings) -> zenoh.Config:
    if settings.config_file is None:
        return zenoh.Config.from_json5(json.dumps(configuration(settings)))
    try:
        return zenoh.Config.from_json5(Path(settings.config_file).read_text(encoding="utf-8"))
    except OSError as error:
        raise ZenohError(f"zenoh.config_file: {settings.config_file} cannot be read: {error.strerror}") from error


def _sentence(settings: ZenohSettings, text: str) -> str:
    if settings.config_file is not None:
        return f"Zenoh does not start with {settings.config_file}: {text}"
    endpoints = ", ".join(settings.connect or settings.listen)
    if settings.connect:
        return f"Zenoh cannot connect to {endpoints}: check the address, and that a router runs there. ({text})"
    if "address already in use" in text.lower() or "os error 98" in text.lower():
        return f"Zenoh cannot listen on {endpoints}: the port is taken. Choose another one with --zenoh-listen."
    return f"Zenoh cannot listen on {endpoints}: {text}"
