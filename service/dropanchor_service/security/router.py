"""The configuration of a Zenoh router that accepts the certificates of one authority, each for its own keys."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dropanchor_service.security.access_control import Holder, access_control, low_pass_filter

BATCH_BYTES = 2**14  # of a network buffer; each connection has several, of 64 KiB by default
LINK: dict[str, Any] = {
    "tx": {"lease": 4000, "keep_alive": 4, "batch_size": BATCH_BYTES},
    "rx": {"max_message_size": 2**20},
}

QUIET: dict[str, Any] = {
    # Without this, a router waits half a second for scouting even when scouting is off.
    "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
    # By default a router adds timestamps to messages, and across sessions these can be out of order. A subscriber with
    # recovery treats out-of-order messages of plain publishers as duplicates, and drops them silently.
    "timestamping": {"enabled": False},
}


def router_transport(tls: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the transport settings that every Dropanchor router changes from Zenoh's defaults."""
    return {
        "shared_memory": {"enabled": False},
        # Sockets that connect and then send nothing must not keep tags out.
        "unicast": {"max_sessions": 20_000, "accept_pending": 2000, "accept_timeout": 2000},
        "link": LINK | ({} if tls is None else {"tls": dict(tls)}),
    }


def router_configuration(
    sites: Sequence[str], tags: Iterable[Holder], listen: Sequence[str], files: Mapping[str, str]
) -> dict[str, Any]:
    """Return the configuration of a router with mutual TLS and access control.

    files: the paths of `ca`, `certificate` and `key` of the router, all PEM.
    """
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
        "access_control": access_control(sites, tags),
        "low_pass_filter": low_pass_filter(sites),
    } | QUIET
