"""The names that a service has: a request for another one comes from a page that turned its own name to this machine.

The browser takes such a page for one of the service (DNS rebinding), and only the header `Host` tells. It takes a name:
an IP address cannot be turned, so every address is allowed.
"""

import ipaddress
from collections.abc import Iterable
from urllib.parse import urlsplit

ALL = "*"


class Hosts:
    """Names by which clients may call a service, in any case. `*.example.com`: all below it; `*`: all."""

    def __init__(self, names: Iterable[str]) -> None:
        lowered = {name.lower().rstrip(".") for name in names}
        self._names = {name for name in lowered if not name.startswith("*.")}
        self._endings = tuple(name[1:] for name in lowered if name.startswith("*."))

    def allows(self, host: str) -> bool:
        """Return whether a service may answer to a host, with or without a port, as in `Host`."""
        name = name_in(host)
        if name is None:
            return False
        return name in self._names or ALL in self._names or name.endswith(self._endings) or _is_address(name)

    def has(self, host: str) -> bool:
        """Return whether a host is one of these names, itself or below one of them."""
        name = name_in(host)
        return name is not None and (name in self._names or name.endswith(self._endings))


def name_in(host: str) -> str | None:
    """Return the name or address in a `Host`, in lower case; None when it is no host."""
    try:
        parts = urlsplit(f"//{host}")
        name = parts.hostname
        _ = parts.port  # raises ValueError when it is no number
    except ValueError:
        return None
    if name is None or parts.netloc != host or parts.username is not None:
        return None
    return name.rstrip(".")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.partition("%")[0])
    except ValueError:
        return False
    return True
