"""What is set of a site over REST, value by value, and what is in force with it: all else is as configured."""

import json
from collections.abc import Mapping
from typing import Literal, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict

from dropanchor_schemas.site import Anchor, RemoteSettings, Site, TagSettings

FORMAT: Literal[2] = 2
Item = TypeVar("Item")


class SiteDocument(BaseModel):
    """What is in force. Files before FORMAT held this."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    site: Site
    tags: dict[str, TagSettings] = {}
    remote: dict[str, RemoteSettings] = {}
    deleted_ns: dict[str, int] = {}  # tags that were deleted, and when, UTC

    def site_with(self, anchor: Anchor) -> Site:
        """Return the site with this anchor, in place of the one with its number."""
        others = [other for other in self.site.anchors if other.number != anchor.number]
        return Site.model_validate(self.site.model_dump() | {"anchors": [*others, anchor]})


class Configured(NamedTuple):
    """What the settings say. tags: complete, with the defaults where their own tables say nothing."""

    site: Site
    tags: Mapping[str, TagSettings]
    defaults: TagSettings

    def tag(self, name: str) -> TagSettings:
        return self.tags.get(name, self.defaults)

    def anchors(self, found: Anchor | None) -> list[Anchor]:
        """Return the configured anchors, or without any the one that was found."""
        return self.site.anchors or ([] if found is None else [found])


class SetValues(BaseModel):
    """What was set, and the content of the file. Of `site` and of each tag, the fields that are set count.

    found: the anchor of the first range, which is in force while none is configured. anchors: by id; None: it was
    removed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[2]
    site: Site
    found: Anchor | None = None
    anchors: dict[str, Anchor | None] = {}
    tags: dict[str, TagSettings] = {}
    remote: dict[str, RemoteSettings] = {}
    deleted_ns: dict[str, int] = {}

    def in_force(self, configured: Configured) -> SiteDocument:
        """Return what is in force with these values."""
        anchors = {anchor.number: anchor for anchor in configured.anchors(self.found)}
        for name, anchor in self.anchors.items():
            if anchor is None:
                anchors.pop(Anchor(id=name).number, None)
            else:
                anchors[anchor.number] = anchor
        of_site = {name: getattr(self.site, name) for name in self.site.model_fields_set - {"id", "anchors"}}
        site = configured.site.model_copy(update=of_site | {"anchors": list(anchors.values())})
        tags = {name: tag for name, tag in configured.tags.items() if name not in self.deleted_ns}
        tags |= {name: tag.over(configured.tag(name)) for name, tag in self.tags.items()}
        return SiteDocument(site=site, tags=tags, remote=self.remote, deleted_ns=self.deleted_ns)

    def with_site(self, site: Site, configured: Configured) -> "SetValues":
        """Return the values with which this site is in force."""
        before = {anchor.number: anchor for anchor in configured.anchors(self.found)}
        left = {anchor.number for anchor in site.anchors}
        removed = {anchor.id: None for number, anchor in before.items() if number not in left}
        changed = {anchor.id: anchor for anchor in site.anchors if anchor != before.get(anchor.number)}
        names = (name for name in Site.model_fields if name not in ("id", "anchors"))
        given = {name: getattr(site, name) for name in names if getattr(site, name) != getattr(configured.site, name)}
        return self.model_copy(
            update={"site": Site.model_validate({"id": site.id, **given}), "anchors": {**removed, **changed}}
        )

    def with_first(self, anchor: Anchor, site: Site, configured: Configured) -> "SetValues":
        """Return the values with which this site is in force, which has the anchor of the first range alone."""
        if configured.site.anchors:  # which were all removed
            return self.with_site(site, configured)
        return self.model_copy(update={"found": anchor, "anchors": {}})

    def with_tag(self, name: str, complete: TagSettings, configured: Configured) -> "SetValues":
        """Return the values with which these settings of a tag are in force."""
        tags = self.tags | {name: differing(complete, configured.tag(name))}
        return self.model_copy(update={"tags": tags, "deleted_ns": without(name, self.deleted_ns)})

    def to_bytes(self) -> bytes:
        return self.model_dump_json(indent=2, exclude_unset=True).encode()


def nothing_set(site: str) -> SetValues:
    return SetValues(format=FORMAT, site=Site(id=site))


def differing(settings: TagSettings, configured: TagSettings) -> TagSettings:
    """Return the settings with those fields alone whose value differs from the configured one."""
    names = (name for name in TagSettings.model_fields if getattr(settings, name) != getattr(configured, name))
    return TagSettings.model_validate({name: getattr(settings, name) for name in names})


def values_in(content: bytes, configured: Configured) -> tuple[SetValues, bool]:
    """Return what is set in a file, and whether the file is an older one, which has all values.

    Of such a file, a value that equals the configured one counts as configured, and any other one as set. Raises
    ValueError.
    """
    document = json.loads(content)
    if isinstance(document, dict) and "format" in document:
        return SetValues.model_validate_json(content), False
    return _migrated(SiteDocument.model_validate_json(content), configured), True


def _migrated(document: SiteDocument, configured: Configured) -> SetValues:
    tags = {
        name: differing(tag.over(configured.tag(name)), configured.tag(name)) for name, tag in document.tags.items()
    }
    given = {name: getattr(document.site, name) for name in document.site.model_fields_set}
    values = nothing_set(document.site.id).with_site(configured.site.model_copy(update=given), configured)
    return values.model_copy(update={"tags": tags, "remote": document.remote, "deleted_ns": document.deleted_ns})


def without(name: str, items: Mapping[str, Item]) -> dict[str, Item]:
    return {other: item for other, item in items.items() if other != name}
