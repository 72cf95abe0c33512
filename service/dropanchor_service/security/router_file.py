"""The router's configuration on the disk: a person may change its endpoints, and all else follows from the table."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


class RouterFileError(ValueError):
    """The file cannot be read. The message says where, and what to do."""


def endpoints_in(file: Path) -> tuple[str, ...] | None:
    """Return the endpoints at which the router shall listen, None if no file says so. Raises RouterFileError."""
    listen = _read(file).get("listen")
    found = listen.get("endpoints") if isinstance(listen, dict) else None
    if isinstance(found, dict):
        found = found.get("router")
    if found is None:
        return None
    endpoints = [found] if isinstance(found, str) else found
    if not isinstance(endpoints, list) or not endpoints or not all(isinstance(one, str) for one in endpoints):
        raise RouterFileError(f'{file}: listen.endpoints must be a list of texts such as "tls/0.0.0.0:7447"')
    return tuple(endpoints)


def unused_changes(file: Path, made: Mapping[str, Any]) -> list[str]:
    """Return the names of the sections of the file that differ from those in use. Raises RouterFileError.

    made: the configuration in use. The endpoints do not count.
    """
    found, used = _read(file), json.loads(json.dumps(made))
    names = dict.fromkeys([*found, *used]) if found else {}
    return [name for name in names if name != "listen" and found.get(name) != used.get(name)]


def _read(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_bytes())
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise RouterFileError(f"{file} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise RouterFileError(
            f"{file} cannot be read: {error}. It must be JSON, without comments; without the file, the endpoints are "
            "those that it was made with"
        ) from error
    if not isinstance(found, dict):
        raise RouterFileError(f"{file} must hold an object")
    return found
