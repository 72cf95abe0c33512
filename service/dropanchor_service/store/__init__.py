"""The current state of the service: the site, its tags and the latest pose of each tag."""

from dropanchor_service.store.health import HealthTable
from dropanchor_service.store.latest_poses import LatestPoses
from dropanchor_service.store.pending_tags import PendingTags
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import Tag, TagTable

__all__ = ["HealthTable", "LatestPoses", "PendingTags", "SiteStore", "Tag", "TagTable"]
