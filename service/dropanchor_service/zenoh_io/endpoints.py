"""The endpoints of the Zenoh router that tags connect to."""

import json
from pathlib import Path

import zenoh

from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io.session import listening_at


def endpoints_of(settings: ZenohSettings, credentials: SecurityFolder | None) -> tuple[str, ...]:
    """The endpoints as they are set: of a router elsewhere, or those where ours listens."""
    if settings.config_file is not None:
        return _in_file(settings.config_file)
    return settings.connect or listening_at(settings, credentials)


def _in_file(file: Path) -> tuple[str, ...]:
    """Of a Zenoh configuration of the operator's own; it was read once before, so it can be."""
    config = zenoh.Config.from_file(str(file))
    mode = json.loads(config.get_json("mode")) or "peer"
    given = json.loads(config.get_json("connect/endpoints" if mode == "client" else "listen/endpoints"))
    found = given.get(mode, []) if isinstance(given, dict) else given
    return (found,) if isinstance(found, str) else tuple(found or ())
