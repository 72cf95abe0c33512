"""Ask whether this process may serve its sites now: in a cluster, whether it owns them."""

from collections.abc import Callable

MayServe = Callable[[], bool]


def always() -> bool:
    """Return True, as for a process that is alone."""
    return True
