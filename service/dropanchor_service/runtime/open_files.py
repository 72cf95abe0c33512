"""Raise the limit on open sockets and files, which is only 1,024 in a login shell."""

import resource


def raise_limit() -> None:
    """Raise the limit to what the system allows. Idle clients hold a socket each until they are disconnected."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
