"""Build the command that starts a simulated tag of a site, and the endpoint that it connects to."""

import shlex
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

_ALL_ADDRESSES = ("0.0.0.0", "[::]", "*")
SIMULATED_ANCHOR = "1"


def reachable_endpoint(endpoint: str, host: str = "localhost") -> str:
    """Return the endpoint to connect to.

    host: name of the machine, used for a router that listens on all of its addresses. What Zenoh is told after a `#` is
    left out: it is for the router, and may be a private key.
    """
    endpoint = endpoint.partition("#")[0]
    protocol, _, address = endpoint.partition("/")
    name, _, port = address.rpartition(":")
    return f"{protocol}/{host}:{port}" if name in _ALL_ADDRESSES else endpoint


def tag_command(*, show_path: bool) -> str:
    """Return the command to call `dropanchor-tag`.

    show_path: with the path of this environment, for people on this machine only.
    """
    if not show_path:
        return "dropanchor-tag"
    script = Path(sysconfig.get_path("scripts")) / "dropanchor-tag"
    return shlex.quote(str(script)) if script.is_file() else f"{shlex.quote(sys.executable)} -m dropanchor_tag_client"


def simulate_command(
    program: str, endpoints: Sequence[str], site: str, anchors: Sequence[str], credentials: str | None
) -> str:
    """Return the command that starts a simulated tag of this site.

    credentials: folder of the tag sim-1, if tags need credentials.
    """
    words = [program, "simulate"]
    words += ["--connect", shlex.quote(endpoints[0])] if endpoints else []
    words += ["--site", shlex.quote(site)] if site != "default" else []
    words += ["--anchor", shlex.quote(anchors[0])] if anchors and SIMULATED_ANCHOR not in anchors else []
    words += ["--credentials", shlex.quote(credentials)] if credentials is not None else []
    return " ".join(words)
