"""The endpoints that tags connect to."""

import json
from pathlib import Path

import zenoh

from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io.session import listening_at


def endpoints_of(settings: ZenohSettings, credentials: SecurityFolder | None) -> tuple[str, ...]:
    """Return the endpoints of the router as configured: an external one, or the one inside the service."""
    if settings.config_file is not None:
        return _endpoints_in(settings.config_file)
    return settings.connect or listening_at(settings, credentials)


def _endpoints_in(file: Path) -> tuple[str, ...]:
    """Return the endpoints in a Zenoh configuration file, which was already read once without an error."""
    config = zenoh.Config.from_file(str(file))
    mode = json.loads(config.get_json("mode")) or "peer"
    configured = json.loads(config.get_json("connect/endpoints" if mode == "client" else "listen/endpoints"))
    found = configured.get(mode, []) if isinstance(configured, dict) else configured
    return (found,) if isinstance(found, str) else tuple(found or ())
