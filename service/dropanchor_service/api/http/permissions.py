"""What a client needs for each request: the one table for the access control, its tests and the reference page.

A request that the table does not name needs `read`, or `write` when it changes something, so a new route is never open
to a share link.
"""

import re
from enum import IntEnum

from dropanchor_service.api.http.site_in_path import OMLOX_PREFIX, divided, is_omlox
from dropanchor_service.security import share_links
from dropanchor_service.security.identity import Identity

PREFIX = "/api/v1/"
OPEN_PATHS = (
    f"{PREFIX}health/live",
    f"{PREFIX}health/ready",
    f"{PREFIX}openapi.json",
    f"{PREFIX}docs",
    f"{OMLOX_PREFIX}v2/openapi.json",
    f"{OMLOX_PREFIX}v1/openapi.json",
)
INGEST = f"{PREFIX}ingest/"
OF_ALL_SITES = (f"{PREFIX}sites", f"{PREFIX}sites/poses")
"""Paths whose answers hold what the client may read of each site."""
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")

_BY_LINKS_TO_TAGS = (
    *("access", "site", "history"),
    *("poses", "stream", "tracks", "figures", "heat-map"),
    *("tags", "tags/{}", "tags/{}/pose", "tags/{}/track", "tags/{}/track/file"),
)
_BY_LINKS = (
    *("sites", "sites/poses", "anchors", "anchors/{}", "tags/{}/explain"),
    *("zones", "zones/{}", "zone-occupancy", "event-rules", "event-rules/{}", "events", "events/stream"),
    *("alarms", "events/file"),
    "history/coverage",
    *("plans", "plans/{}", "plan-images/{}", "basemap", "basemap/{}/{}/{}"),
)
_OF_ADMINISTRATORS = (f"{PREFIX}shares", f"{PREFIX}keys")
"""Share links and keys: nobody else even reads them."""
_CHANGED_BY_ADMINISTRATORS = re.compile(f"{PREFIX}(site|destinations/.*|receiver-networks/.*)", re.DOTALL)


class Need(IntEnum):
    """What a request needs. From LINK_TO_TAGS to ADMIN, each includes those before; TAG stands apart."""

    NOTHING = 0
    LINK_TO_TAGS = 1
    LINK = 2
    READ = 3
    WRITE = 4
    ADMIN = 5
    TAG = 6


def _pattern(templates: tuple[str, ...]) -> re.Pattern[str]:
    either = "|".join(re.escape(template).replace(r"\{\}", "[^/]+") for template in templates)
    return re.compile(f"{PREFIX}({either})")


_READ_BY = {Need.LINK_TO_TAGS: _pattern(_BY_LINKS_TO_TAGS), Need.LINK: _pattern(_BY_LINKS)}


def need_of(method: str, path: str) -> Need:
    """Return what a request needs. path: as the interface has it, escaped; of a site, or without it."""
    if not _is_protected(path):
        return Need.NOTHING
    path = divided(path)[1]
    if path.startswith(INGEST):
        return Need.TAG
    if path.startswith(_OF_ADMINISTRATORS):
        return Need.ADMIN
    if method in SAFE_METHODS:
        return _need_to_read(path)
    is_admin = method == "DELETE" or _CHANGED_BY_ADMINISTRATORS.fullmatch(path)
    return Need.ADMIN if is_admin else Need.WRITE


def _need_to_read(path: str) -> Need:
    if is_omlox(path):
        return Need.LINK
    return next((need for need, pattern in _READ_BY.items() if pattern.fullmatch(path)), Need.READ)


def _is_protected(path: str) -> bool:
    """Return whether a path needs credentials. The dashboard's files do not: they hold no data of the site."""
    if is_omlox(path):
        return divided(path)[1] not in OPEN_PATHS
    return path.startswith(("/api/", "/metrics")) and path not in OPEN_PATHS


def has_in(identity: Identity, site: str | None) -> Need:
    """Return what a client has in a site, NOTHING to ADMIN. site: None for what concerns all sites."""
    scope = identity.scope_in(site)
    if scope is None:
        return Need.NOTHING
    if identity.source == share_links.SOURCE:
        return Need.LINK if identity.limit is None else Need.LINK_TO_TAGS
    return Need[scope.name]
