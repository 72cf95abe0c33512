"""Buckets: the sites that one process serves at a time. Pure.

The id of a clustered site begins with its bucket, three digits and a dot: `017.yard`. Sites without that are all in one
bucket, which the settings name.
"""

import re
from collections.abc import Iterable

_BUCKET = re.compile(r"([0-9]{3})\..+", re.DOTALL)
_EXAMPLE = "give each id its bucket, three digits and a dot: 017.yard"


def bucket_of(site: str) -> str | None:
    """Return the bucket of a site, None if its id has none."""
    found = _BUCKET.fullmatch(site)
    return None if found is None else found[1]


def common_bucket(sites: Iterable[str]) -> str | None:
    """Return the bucket of these sites, None if they have several or none."""
    found = {bucket_of(site) for site in sites}
    return found.pop() if len(found) == 1 else None


def buckets_in(sites: Iterable[str]) -> list[str]:
    """Return the buckets of these sites, sorted; none if their ids have none."""
    return sorted({bucket for site in sites if (bucket := bucket_of(site)) is not None})


def refuse_unfit_buckets(sites: Iterable[str], bucket: str | None) -> None:
    """Raise ValueError unless all sites have a bucket or none has, and some are in this bucket, if one is named."""
    ids = list(sites)
    known, without = buckets_in(ids), [site for site in ids if bucket_of(site) is None]
    if known and without:
        raise ValueError(f"some ids of sites have a bucket, but {without[0]!r} has none: {_EXAMPLE}")
    if bucket is None and not known:
        raise ValueError(f"name the sites of this process with cluster.bucket, or {_EXAMPLE}")
    if bucket is not None and bucket not in (known or [bucket]):
        raise ValueError(f"cluster.bucket is {bucket!r}, but the sites have the buckets {', '.join(known)}")
