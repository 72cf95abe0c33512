"""The current state of the service: the sites, their tags and the latest pose of each tag."""

from dropanchor_service.store.health import HealthTable
from dropanchor_service.store.latest_poses import LatestPoses
from dropanchor_service.store.pending_tags import PendingTags
from dropanchor_service.store.rows import Rows, Tag
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.sites import ServedSite, Sites
from dropanchor_service.store.tags import TagTable

__all__ = [
    "HealthTable",
    "LatestPoses",
    "PendingTags",
    "Rows",
    "ServedSite",
    "SiteStore",
    "Sites",
    "Tag",
    "TagTable",
]
