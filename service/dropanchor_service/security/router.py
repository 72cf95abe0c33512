"""The configuration of a Zenoh router that lets in certificates of one authority, each to its own keys."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dropanchor_service.security.access_control import access_control, low_pass_filter

LINK: dict[str, Any] = {"tx": {"lease": 4000, "keep_alive": 4}, "rx": {"max_message_size": 2**20}}

QUIET: dict[str, Any] = {
    # A router waits for what it might find for half a second, even where it does not look.
    "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
    # Routers stamp messages by default, one after another for each session. A subscriber with recovery takes those of
    # plain publishers whose stamps are out of order for repeated ones, and drops them without a word.
    "timestamping": {"enabled": False},
}


def router_transport(tls: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What not to leave at its default, for every router of ours."""
    return {
        "shared_memory": {"enabled": False},
        # Silent sockets, which send nothing after they connect, must not keep tags out.
        "unicast": {"max_sessions": 20_000, "accept_pending": 2000, "accept_timeout": 2000},
        "link": LINK | ({} if tls is None else {"tls": dict(tls)}),
    }


def router_configuration(
    site: str, tags: Iterable[str], listen: Sequence[str], files: Mapping[str, str]
) -> dict[str, Any]:
    """files: `ca`, `certificate` and `key` of the router, PEM."""
    tls = {
        "root_ca_certificate": files["ca"],
        "listen_certificate": files["certificate"],
        "listen_private_key": files["key"],
        "enable_mtls": True,
        "close_link_on_expiration": True,
    }
    return {
        "mode": "router",
        "listen": {"endpoints": list(listen)},
        "transport": router_transport(tls),
        "access_control": access_control(site, tags),
        "low_pass_filter": low_pass_filter(site),
    } | QUIET
