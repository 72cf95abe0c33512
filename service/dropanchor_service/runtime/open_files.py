"""How many sockets and files the process may open: as many as the system allows, not the 1,024 of a login shell."""

import resource


def allow_all() -> None:
    """Clients that connect and say nothing hold a socket each until they are cut."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
