"""Find the address of a receiver, and refuse addresses of the inside.

The connection goes to the address that was checked. A name that resolves to another address a moment later changes
nothing.
"""

import asyncio
import ipaddress
import socket
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from dropanchor_schemas.sentences import said_by, say
from dropanchor_service.delivery.public_addresses import Address, Network, address_of, is_public
from dropanchor_service.delivery.receiver_networks import network_around

if TYPE_CHECKING:
    import httpx


class UrlError(ValueError):
    """The URL cannot be used. The message says what to do."""


class RefusedAddressError(UrlError):
    """The receiver has an address that is not allowed. network: the one that the page can allow; None: it cannot."""

    network: Network | None = None


def checked_url(url: str) -> "httpx.URL":
    """Return the parsed URL. Raises UrlError."""
    import httpx  # see `tls_context`

    try:
        parsed = httpx.URL(url)
        host = parsed.host
    except (httpx.InvalidURL, UnicodeError) as error:
        raise UrlError(say("url_unreadable", "the URL cannot be read: {why}", why=said_by(error))) from error
    if parsed.scheme not in ("http", "https") or not host:
        raise UrlError(say("url_scheme", "the URL must begin with https:// or http:// and name a host"))
    if parsed.userinfo:
        raise UrlError(
            say(
                "url_password", "the URL must not hold a name or password: the receiver can check the signature instead"
            )
        )
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
        address = address_of(text)
        if not is_public(address) and not any(address in network for network in listed):
            raise _refusal(address)
    return addresses[0]


def _refusal(address: Address) -> RefusedAddressError:
    """Return why a receiver is refused, and the nearest way to mend that."""
    network = network_around(address)
    if network is not None:
        refused = RefusedAddressError(
            say(
                "private_address",
                "the receiver has the address {address}, which is not public: an administrator can allow "
                "{network} on the page (webhooks and mail servers), or with `allow_networks` in "
                "`[delivery]` of the settings",
                address=address,
                network=network,
            )
        )
        refused.network = network
        return refused
    if address.is_loopback:
        return RefusedAddressError(
            say(
                "own_address",
                "the receiver has the address {address}, which is the machine of the service itself: give "
                "the address that this machine has in your network, or allow it with `allow_networks` in "
                "`[delivery]` of the settings",
                address=address,
            )
        )
    return RefusedAddressError(
        say(
            "other_address",
            "the receiver has the address {address}, which only the settings can allow: "
            "`allow_networks` in `[delivery]`",
            address=address,
        )
    )


def is_told(server: str) -> bool:
    """Return whether the settings of a server tell its address itself, which an administrator then means."""
    try:
        return server.lower().rstrip(".") == "localhost" or ipaddress.ip_address(server.strip("[]")) is not None
    except ValueError:
        return False


async def connected(server: str, port: int, networks: Iterable[Network]) -> socket.socket:
    """Return a socket that is connected to a server. Raises OSError, and RefusedAddressError before it connects."""
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(server, port, type=socket.SOCK_STREAM)
    if not is_told(server):
        allowed([str(entry[4][0]) for entry in found], networks)
    problem: OSError | None = None
    for family, kind, protocol, _, place in found:
        opened = socket.socket(family, kind, protocol)
        try:
            opened.setblocking(False)
            await loop.sock_connect(opened, place)
        except BaseException as error:
            opened.close()
            if not isinstance(error, OSError):
                raise
            problem = error
        else:
            return opened
    raise problem or OSError(f"{server} has no address")
