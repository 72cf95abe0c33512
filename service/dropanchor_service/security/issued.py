"""The table of the folder of credentials: its sites, and the certificates that were issued to their tags."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from dropanchor_schemas.models import Exact
from dropanchor_service.security.access_control import Holder


class IssuedTag(Exact):
    """The record of a certificate that was issued to a tag. site: None for a tag of the folder's first site."""

    serial: str
    expires: datetime
    revoked: datetime | None = None
    site: str | None = None


class Table(Exact):
    """The issued certificates and the addresses of the router.

    site: the first site. more_sites: those that share its router. tags: by the common names of their certificates.
    """

    site: str
    hosts: tuple[str, ...]
    listen: tuple[str, ...]
    tags: Mapping[str, IssuedTag] = {}
    more_sites: tuple[str, ...] = ()

    @property
    def sites(self) -> tuple[str, ...]:
        return (self.site, *self.more_sites)

    @property
    def admitted(self) -> list[str]:
        """The common names of the tags whose certificates are not revoked."""
        return [name for name, tag in self.tags.items() if tag.revoked is None]

    def common_name(self, site: str, tag: str) -> str:
        """Return the common name of the certificate of a tag. A tag of the first site has its id alone."""
        return tag if site == self.site else f"{site}/{tag}"

    def holder(self, name: str) -> Holder:
        """Return the tag whose certificate has this common name."""
        site = self.tags[name].site
        return Holder(name, self.site, name) if site is None else Holder(name, site, name.removeprefix(f"{site}/"))

    def document(self) -> dict[str, Any]:
        """Return what the file holds: of an only site nothing that only several sites need."""
        document = self.model_dump(mode="json", exclude=None if self.more_sites else {"more_sites"})
        for tag in document["tags"].values():
            if tag["site"] is None:
                del tag["site"]
        return document
