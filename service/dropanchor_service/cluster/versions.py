"""Which version is installed on this machine now. A process goes on with the one that it was started with."""

import sys
from importlib.metadata import PackageNotFoundError, version


def installed() -> str:
    """Return the version of the service that a new process would run; empty while none is installed.

    If a new Ray is installed under a running one, the text says so: new processes could not talk to the old ones.
    """
    try:
        service, ray = version("dropanchor-service"), version("ray")
    except PackageNotFoundError:
        return _service_alone()
    running = getattr(sys.modules.get("ray"), "__version__", ray)
    return service if running == ray else f"{service} with Ray {ray} under the running {running}"


def _service_alone() -> str:
    try:
        return version("dropanchor-service")
    except PackageNotFoundError:
        return ""
