"""The addresses of this machine, and of what listens on it, for others."""

import ipaddress
import socket
from collections.abc import Iterator
from contextlib import suppress
from urllib.parse import urlsplit

import ifaddr

_ELSEWHERE = ("192.0.2.1", 9)  # for documentation (RFC 5737); nothing is sent there


def urls_for_others(url: str) -> Iterator[str]:
    """Yield the URLs at which other devices reach a service that listens at this URL."""
    parts = urlsplit(url)
    host = ipaddress.ip_address(parts.hostname or "")
    if host.is_loopback:
        return
    for address in own_addresses() if host.is_unspecified else [host]:
        if address.version <= host.version:  # a socket for IPv6 takes IPv4, too
            name = f"[{address}]" if address.version == 6 else str(address)
            yield f"{parts.scheme}://{name}:{parts.port}"


def own_addresses() -> list[ipaddress.IPv4Address | ipaddress.IPv6Address]:
    """Return the addresses of this machine that others can use, that of the default route first."""
    texts = [ip.ip if isinstance(ip.ip, str) else ip.ip[0] for adapter in ifaddr.get_adapters() for ip in adapter.ips]
    addresses = [ipaddress.ip_address(text) for text in texts]
    usable = [address for address in addresses if not (address.is_loopback or address.is_link_local)]
    routed = _routed_address()
    return sorted(usable, key=lambda address: (str(address) != routed, address.version))


def _routed_address() -> str:
    """Return the address that this machine uses towards other networks; "" without a route."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
        probe.connect(_ELSEWHERE)
        return str(probe.getsockname()[0])
    return ""
