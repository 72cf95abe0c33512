"""Which version is installed on this machine now. A process goes on with the one that it was started with."""

import re
import sys
from importlib.metadata import PackageNotFoundError, distribution

_VERSION = re.compile(r"^Version: (.*)$", re.MULTILINE)


def installed() -> str:
    """Return the version of the service that a new process would run; empty while none is installed.

    If another Ray is installed under a running one, the text says so: new processes could not talk to the old ones.
    """
    service, ray = _version_of("dropanchor-service"), _version_of("ray")
    running = getattr(sys.modules.get("ray"), "__version__", ray)
    return service if running == ray else f"{service} with Ray {ray} under the running {running}"


def _version_of(name: str) -> str:
    """Return the version of a distribution. `importlib.metadata.version` would parse all that is said about it."""
    try:
        found = _VERSION.search(distribution(name).read_text("METADATA") or "")
    except PackageNotFoundError:
        return ""
    return "" if found is None else found[1]
