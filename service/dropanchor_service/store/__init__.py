"""What the service knows at this moment: the site, the tags, and the latest pose of each."""

from dropanchor_service.store.latest_poses import LatestPoses
from dropanchor_service.store.pending_tags import PendingTags
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import Tag, TagTable

__all__ = ["LatestPoses", "PendingTags", "SiteStore", "Tag", "TagTable"]
