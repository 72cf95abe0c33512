"""The command that starts a simulated tag of a site, and where it connects."""

import shlex
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

_EVERYWHERE = ("0.0.0.0", "[::]", "*")
SIMULATED_ANCHOR = "1"


def reached_at(endpoint: str, host: str = "localhost") -> str:
    """The endpoint to connect to. host: a name of the machine, for a router that listens at all of its addresses."""
    protocol, _, address = endpoint.partition("/")
    name, _, port = address.rpartition(":")
    return f"{protocol}/{host}:{port}" if name in _EVERYWHERE else endpoint


def tag_command(*, show_path: bool) -> str:
    """How `dropanchor-tag` is called: of this environment with its path, which is for people on this machine only."""
    if not show_path:
        return "dropanchor-tag"
    script = Path(sysconfig.get_path("scripts")) / "dropanchor-tag"
    return shlex.quote(str(script)) if script.is_file() else f"{shlex.quote(sys.executable)} -m dropanchor_tag_client"


def simulate_command(
    program: str, endpoints: Sequence[str], site: str, anchors: Sequence[str], credentials: str | None
) -> str:
    """Starts a simulated tag of this site. credentials: the folder of the tag sim-1, where tags need one."""
    words = [program, "simulate"]
    words += ["--connect", shlex.quote(endpoints[0])] if endpoints else []
    words += ["--site", shlex.quote(site)] if site != "default" else []
    words += ["--anchor", shlex.quote(anchors[0])] if anchors and SIMULATED_ANCHOR not in anchors else []
    words += ["--credentials", shlex.quote(credentials)] if credentials is not None else []
    return " ".join(words)
