"""Divide a path of the interface into the site that it names and the rest."""

import re
from urllib.parse import unquote

_PREFIX = "/api/v1"
_OF_SITE = re.compile(f"{_PREFIX}/sites/([^/]+)(/.*)")


def divided(path: str) -> tuple[str | None, str]:
    """Return the site in a path, None without one, and the path as an only site has it."""
    found = _OF_SITE.fullmatch(path)
    return (None, path) if found is None else (unquote(found[1], errors="replace"), _PREFIX + found[2])
