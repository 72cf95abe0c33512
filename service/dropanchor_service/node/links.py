"""Connections to the owners."""

import ssl
from pathlib import Path

import httpx

from dropanchor_service.node.owners import Owner, Owners
from dropanchor_service.node.request import Asked

TIMEOUTS = {"connect": 2.0, "read": 60.0, "write": 10.0, "pool": 5.0}
"""In s. A stream is never silent for so long."""
IDLE_S = 3.0  # the services close an idle connection after 5 s, and a request must not meet that
MOST_IDLE = 64


class Links:
    """Sends requests to owners over connections that stay open. certificates: see `trusted`."""

    def __init__(self, owners: Owners, certificates: ssl.SSLContext) -> None:
        self._owners = owners
        self.certificates = certificates
        self._transports: dict[str, httpx.AsyncHTTPTransport] = {}

    async def ask(self, owner: Owner, asked: Asked) -> httpx.Response:
        """Return the owner's answer, whose body is still to come. Raises httpx.TransportError."""
        request = httpx.Request(asked.method, owner.address, headers=asked.headers, content=asked.body.content())
        prefix = httpx.URL(owner.address).raw_path.rstrip(b"/")
        request.extensions = {"timeout": TIMEOUTS, "target": prefix + asked.target}
        return await self._transport(owner.address).handle_async_request(request)

    async def close(self) -> None:
        for address in list(self._transports):
            await self._transports.pop(address).aclose()

    def _transport(self, address: str) -> httpx.AsyncHTTPTransport:
        if address not in self._transports:
            limits = httpx.Limits(max_connections=None, max_keepalive_connections=MOST_IDLE, keepalive_expiry=IDLE_S)
            self._transports[address] = httpx.AsyncHTTPTransport(
                verify=self.certificates, trust_env=False, limits=limits
            )
        return self._transports[address]

    async def forget_former(self) -> None:
        """Close the connections to addresses that are no owner's any longer."""
        for address in self._transports.keys() - self._owners.addresses:
            await self._transports.pop(address).aclose()


def trusted(authority: Path | None) -> ssl.SSLContext:
    """Return what certificates of services must be signed by: a usual authority, or that of the folder `security`."""
    context = ssl.create_default_context()
    if authority is not None:
        context.load_verify_locations(authority)
    return context
