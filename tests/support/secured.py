"""A secured site: its credentials, a router that demands them, and sessions that have them."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import zenoh

from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.issued import Table
from support.zenoh_router import free_port


@dataclass
class SecuredSite:
    """The folder that `dropanchor security init` and `dropanchor tag add` make, and the endpoint of its router."""

    folder: SecurityFolder
    endpoint: str

    @contextmanager
    def router(self, access_control: bool = True) -> Iterator[None]:
        """Run the router of the site until the block ends."""
        configuration = self.folder.router_configuration()
        if not access_control:
            del configuration["access_control"]
        with zenoh.open(zenoh.Config.from_json5(json.dumps(configuration))):
            yield

    @contextmanager
    def session(self, name: str) -> Iterator[zenoh.Session]:
        """Open a session as `service`, as a reader (by the name of its files), or as the tag of that common name."""
        path = self.folder.path
        is_tag = name in self.folder.table.tags
        cert, key = (
            self.folder.bundle(name) / f"tag.{end}" if is_tag else path / f"{name}.{end}" for end in ("pem", "key")
        )
        tls = {
            "root_ca_certificate": str(path / "ca.pem"),
            "enable_mtls": True,
            "connect_certificate": str(cert),
            "connect_private_key": str(key),
        }
        configuration = {
            "mode": "client",
            "connect": {"endpoints": [self.endpoint], "timeout_ms": 10_000},
            "scouting": {"multicast": {"enabled": False}},
            "transport": {"shared_memory": {"enabled": False}, "link": {"tls": tls}},
        }
        with zenoh.open(zenoh.Config.from_json5(json.dumps(configuration))) as session:
            yield session


def secured_site(
    path: Path, *tags: str, site: str = "default", host: str = "localhost", address: str = "127.0.0.1"
) -> SecuredSite:
    """Make the credentials of a site with these tags.

    host: name in the certificates. address: where the router listens.
    """
    port = free_port()
    table = Table(site=site, hosts=(host, "127.0.0.1"), listen=(f"tls/{address}:{port}",))
    folder = SecurityFolder.make(path, table, days=30)
    for tag in tags:
        folder.add_tag(tag, days=30)
    return SecuredSite(folder, f"tls/{host}:{port}")
