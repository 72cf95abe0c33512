"""The topics, and what feeds a subscription to each of them."""

from collections.abc import Iterator
from typing import Protocol

from dropanchor_service.answers.answers import Answer
from dropanchor_service.api.http.errors import ProblemError
from dropanchor_service.api.omlox.feed.events import CollisionFeed, FenceEventFeed
from dropanchor_service.api.omlox.feed.messages import Code, FeedError, Params
from dropanchor_service.api.omlox.feed.positions import MotionFeed, PositionFeed
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.parameters import require_zone
from dropanchor_service.api.omlox.projection import Projection, projection_of

GEOJSON = ":geojson"
TOPICS = (
    "location_updates",
    f"location_updates{GEOJSON}",
    "trackable_motions",
    f"trackable_motions{GEOJSON}",
    "fence_events",
    f"fence_events{GEOJSON}",
    "collision_events",
    "proximity_updates",
)


class Feed(Protocol):
    """What one subscription has not received yet."""

    def payloads(self) -> Iterator[list[Answer]]:
        """Yield the payload of each message that is due."""


class NoFeed:
    """Of the topic that this service has nothing for: it has no proximity providers."""

    def payloads(self) -> Iterator[list[Answer]]:
        return iter(())


def feed_of(hub: Hub, topic: str | None, params: Params) -> Feed:
    """Return the feed of a new subscription, which begins now. Raises FeedError."""
    if topic not in TOPICS:
        raise FeedError(Code.UNKNOWN_TOPIC, f"There is no topic with this name. The topics are: {', '.join(TOPICS)}.")
    name, geojson = topic.removesuffix(GEOJSON), topic.endswith(GEOJSON)

    def project() -> Projection:
        return projection_of(hub.answers.site.site, params.crs, geojson)

    try:
        require_zone(hub, params.zone_id)
        project()
    except ProblemError as error:
        raise FeedError(Code.SUBSCRIPTION_FAILED, str(error.detail)) from error
    match name:
        case "location_updates":
            return PositionFeed(hub, params, project, geojson)
        case "trackable_motions":
            return MotionFeed(hub, params, project, geojson)
        case "fence_events":
            return FenceEventFeed(hub, params, project if geojson else None)
        case "collision_events":
            return CollisionFeed(hub, params)
    return NoFeed()
