"""The sites of a process without its other parts."""

from dropanchor_schemas.site import Site
from dropanchor_service.settings.quota import Quota
from dropanchor_service.store import Sites, SiteStore


def make_sites(*names: str) -> Sites:
    """Return sites without anchors and tags; without names, the one that a service has by default."""
    return Sites([(SiteStore(Site(id=name), {}), Quota()) for name in names or ("default",)])
