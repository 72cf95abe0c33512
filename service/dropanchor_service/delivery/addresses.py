"""Find the address of a receiver, and refuse addresses of the inside.

The request goes to the address that was checked. A name that resolves to another address a moment later changes
nothing.
"""

import ipaddress
import socket
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import httpx

Network = ipaddress.IPv4Network | ipaddress.IPv6Network
Address = ipaddress.IPv4Address | ipaddress.IPv6Address

_NAT64 = ipaddress.ip_network("64:ff9b::/96")


class UrlError(ValueError):
    """The URL cannot be used. The message says what to do."""


class RefusedAddressError(UrlError):
    """The receiver has an address that the settings do not allow."""


def checked_url(url: str) -> "httpx.URL":
    """Return the parsed URL. Raises UrlError."""
    import httpx  # see `tls_context`

    try:
        parsed = httpx.URL(url)
        host = parsed.host
    except (httpx.InvalidURL, UnicodeError) as error:
        raise UrlError(f"the URL cannot be read: {error}") from error
    if parsed.scheme not in ("http", "https") or not host:
        raise UrlError("the URL must begin with https:// or http:// and name a host")
    if parsed.userinfo:
        raise UrlError("the URL must not hold a name or password: the receiver can check the signature instead")
    return parsed


def resolved(url: "httpx.URL") -> list[str]:
    """Return the addresses of the host of the URL. Blocks. Raises OSError."""
    port = url.port or (443 if url.scheme == "https" else 80)
    found = socket.getaddrinfo(url.host, port, type=socket.SOCK_STREAM)
    return list(dict.fromkeys(str(entry[4][0]) for entry in found))


def allowed(addresses: Sequence[str], networks: Iterable[Network]) -> str:
    """Return the first address, if all of them are public or in these networks. Raises RefusedAddressError."""
    listed = tuple(networks)
    for text in addresses:
        address = ipaddress.ip_address(text.partition("%")[0])
        if not _is_public(address) and not any(address in network for network in listed):
            raise RefusedAddressError(
                f"the receiver has the address {address}, which is not public: an administrator can allow it with "
                "`allow_networks` in `[delivery]` of the settings"
            )
    return addresses[0]


def _is_public(address: Address) -> bool:
    """Return whether the address lies on the public internet, also by what is embedded in it."""
    if isinstance(address, ipaddress.IPv6Address):
        embedded = [address.ipv4_mapped, address.sixtofour, *(address.teredo or ())]
        if address in _NAT64:
            embedded.append(ipaddress.IPv4Address(int(address) & 0xFFFFFFFF))
        if any(inner is not None and not _is_public(inner) for inner in embedded):
            return False
        if address.ipv4_mapped is not None:
            return True
    return address.is_global and not address.is_multicast
