"""Which bucket a request is about. Pure."""

from collections.abc import Collection
from enum import Enum, auto

from dropanchor_service.api.http.permissions import OF_ALL_SITES
from dropanchor_service.settings.buckets import bucket_of

OF_ANY_SITE = ("/api/v1/openapi.json", "/omlox/v1/openapi.json", "/omlox/v2/openapi.json")
"""Paths whose answer is the same everywhere. Of all sites the owners answer in part: see `all_sites`."""


class Unknown(Enum):
    """Why no bucket is found."""

    NO_BUCKETS = auto()
    SITE = auto()
    NO_SITE = auto()


def bucket_for(path: str, site: str | None, buckets: Collection[str]) -> str | Unknown:
    """Return the bucket that a request is about. site: the one that its path or its key names; None: neither does.

    An only bucket has every site. Of several, the one has a site with which its id begins, and one that is not three
    digits has the sites whose ids begin with none.
    """
    if not buckets:
        return Unknown.NO_BUCKETS
    if len(buckets) == 1 or path in (*OF_ANY_SITE, *OF_ALL_SITES):
        return min(buckets)
    if site is None:
        return Unknown.NO_SITE
    named = bucket_of(site)
    if named is not None:
        return named if named in buckets else Unknown.SITE
    others = [bucket for bucket in buckets if bucket_of(f"{bucket}.x") is None]
    return others[0] if len(others) == 1 else Unknown.SITE
