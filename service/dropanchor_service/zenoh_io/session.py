"""Open the Zenoh session of the service: its own router, or a client of an external one."""

import json
from pathlib import Path
from typing import Any

import zenoh

from dropanchor_service.runtime import open_files
from dropanchor_service.security.access_control import SERVICE
from dropanchor_service.security.folder import SecurityError, SecurityFolder
from dropanchor_service.security.router import LINK, QUIET, router_transport
from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io import receive_threads

ATTEMPT_S = 1.0


class ZenohError(Exception):
    """The session cannot be opened; the message says what to check."""


def open_session(settings: ZenohSettings, credentials: SecurityFolder | None = None) -> zenoh.Session:
    """Open a session with these settings. Raises ZenohError."""
    if not settings.connect:
        receive_threads.set_receive_threads()
    try:
        return zenoh.open(_config(settings, credentials))
    except zenoh.ZError as error:
        raise ZenohError(_explain(settings, str(error))) from error


def listening_at(settings: ZenohSettings, credentials: SecurityFolder | None) -> tuple[str, ...]:
    """Return the endpoints where the router of the service listens. Raises SettingsError."""
    if credentials is None or "listen" in settings.model_fields_set:
        return settings.listen
    try:
        return credentials.listen
    except SecurityError as error:
        raise SettingsError(f"security.folder: {error}") from error


def configuration(settings: ZenohSettings, credentials: SecurityFolder | None = None) -> dict[str, Any]:
    """Return the Zenoh configuration for these settings, when no file provides one."""
    if settings.connect:
        return _client(settings, credentials) | QUIET
    listen = listening_at(settings, credentials)
    if credentials is not None:
        return _within_open_files(credentials.router_configuration(listen))
    transport = router_transport()
    return _within_open_files({"mode": "router", "listen": {"endpoints": list(listen)}, "transport": transport}) | QUIET


def _within_open_files(router: dict[str, Any]) -> dict[str, Any]:
    """Return the configuration of a router with no more sessions than files that it may open."""
    most = open_files.shares().zenoh
    unicast = router["transport"]["unicast"]
    fewer = {name: min(unicast[name], most) for name in ("max_sessions", "accept_pending")}
    return router | {"transport": router["transport"] | {"unicast": unicast | fewer}}


def _client(settings: ZenohSettings, credentials: SecurityFolder | None) -> dict[str, Any]:
    return {
        "mode": "client",
        "connect": {
            "endpoints": list(settings.connect),
            # An endless attempt inside Zenoh cannot be interrupted. A finite one still reconnects forever.
            "timeout_ms": round(ATTEMPT_S * 1000),
            "exit_on_failure": True,
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2},
        },
        "transport": {"shared_memory": {"enabled": False}, "link": LINK | _tls(credentials)},
    }


def _tls(credentials: SecurityFolder | None) -> dict[str, Any]:
    if credentials is None:
        return {}
    return {
        "tls": {
            "root_ca_certificate": str(credentials.certificate("ca")),
            "enable_mtls": True,
            "connect_certificate": str(credentials.certificate(SERVICE)),
            "connect_private_key": str(credentials.key(SERVICE)),
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        }
    }


def _config(settings: ZenohSettings, credentials: SecurityFolder | None) -> zenoh.Config:
    if settings.config_file is None:
        return zenoh.Config.from_json5(json.dumps(configuration(settings, credentials)))
    try:
        return zenoh.Config.from_json5(Path(settings.config_file).read_text(encoding="utf-8"))
    except OSError as error:
        raise ZenohError(f"zenoh.config_file: {settings.config_file} cannot be read: {error.strerror}") from error


def _explain(settings: ZenohSettings, text: str) -> str:
    if settings.config_file is not None:
        return f"Zenoh cannot start with {settings.config_file}: {text}"
    endpoints = ", ".join(settings.connect or settings.listen)
    if settings.connect:
        return (
            f"Zenoh cannot connect to {endpoints}: check the address, that a router runs there, and whether it "
            f"requires a certificate (--security). ({text})"
        )
    if "address already in use" in text.lower() or "os error 98" in text.lower():
        return f"Zenoh cannot listen on {endpoints}: the port is in use. Choose another one with --zenoh-listen."
    return f"Zenoh cannot listen on {endpoints}: {text}"
