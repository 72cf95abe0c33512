"""Raise the limit on open sockets and files, which is only 1,024 in a login shell, and share it out."""

import resource
from typing import NamedTuple

RESERVE = 64  # open files for the process itself: checkpoints, history, recordings, deliveries; at rest it has 20
MOST = 20_000  # connections of either kind
LEAST = 8


class Shares(NamedTuple):
    """How many connections of each kind the limit leaves room for."""

    http: int
    zenoh: int


def raise_limit() -> None:
    """Raise the limit to what the system allows. Idle clients hold a socket each until they are disconnected."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def shares() -> Shares:
    """Return how many connections fit, so that the files of RESERVE can be opened all the same."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return Shares(MOST, MOST)
    each = max(LEAST, min((soft - RESERVE) // 2, MOST))
    return Shares(each, each)
