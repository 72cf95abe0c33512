"""Divide a path of the interfaces into the site that it names and the rest."""

import re
from urllib.parse import unquote

OMLOX_PREFIX = "/omlox/"
"""Begin of the paths of the omlox interface of an only site; those of one of several stand below `/sites/SITE`."""

_PREFIX = "/api/v1"
_FEATURES = f"{_PREFIX}/ogc"
_OF_SITE = re.compile(f"({_PREFIX}|)/sites/([^/]+)(/.*)", re.DOTALL)


def divided(path: str) -> tuple[str | None, str]:
    """Return the site in a path, None without one, and the path as an only site has it."""
    found = _OF_SITE.fullmatch(path)
    if found is None or not (found[1] or found[3].startswith(OMLOX_PREFIX)):
        return None, path
    return unquote(found[2], errors="replace"), found[1] + found[3]


def is_omlox(path: str) -> bool:
    """Return whether a path is of the omlox interface."""
    return path.startswith(OMLOX_PREFIX) or (path.startswith("/sites/") and divided(path)[0] is not None)


def knows_no_422(path: str) -> bool:
    """Return whether the standard of this interface, omlox or OGC API – Features, wants 400 for what is not valid."""
    return is_omlox(path) or (divided(path)[1] + "/").startswith(f"{_FEATURES}/")
