"""The topics that follow positions. A client that reads slowly gets the newest ones when it is ready again."""

from collections.abc import Callable, Iterator

from dropanchor_service.answers.answers import Answer
from dropanchor_service.api.omlox.feed.messages import Params, allows
from dropanchor_service.api.omlox.geojson import collection, location_feature, motion_feature
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.projection import Projection
from dropanchor_service.api.omlox.zones import anchor_of

MAX_OBJECTS = 500  # in one message

_FLOOR = 0.0  # the ground floor, which is meant where a location names none

Project = Callable[[], Projection]
"""Returns the projection of a subscription: the site may get another georeference. Raises ProblemError."""


class PositionFeed:
    """The positions that one subscription has not received yet, from its beginning on."""

    def __init__(self, hub: Hub, params: Params, project: Project, geojson: bool) -> None:
        self._hub = hub
        self._params = params
        self._project = project
        self._geojson = geojson
        self._version = hub.answers.latest.version

    def payloads(self) -> Iterator[list[Answer]]:
        """Yield the payload of each message that is due. Raises ProblemError."""
        projection = self._project()
        self._version, poses = self._hub.answers.latest.since(self._version)
        poses = self._hub.answers.tags.own(poses)
        for begin in range(0, len(poses), MAX_OBJECTS):
            locations = self._hub.places.of_poses(poses[begin : begin + MAX_OBJECTS], projection)
            found = self._objects([location for location in locations if self._wants(location)], projection)
            if found:
                yield [collection(map(self._feature, found))] if self._geojson else found

    def _objects(self, locations: list[Answer], projection: Projection) -> list[Answer]:  # noqa: ARG002
        return locations

    def _feature(self, found: Answer) -> Answer:
        return location_feature(found)

    def _wants(self, location: Answer) -> bool:
        params = self._params
        return (
            allows(params.provider_id, location["provider_id"])
            and allows(params.provider_type, location["provider_type"])
            and allows(params.source, location["source"], anchor_of(self._hub.answers.site.site, location["source"]))
            and params.floor in (None, _FLOOR)
            and (params.accuracy is None or location.get("accuracy", float("inf")) <= params.accuracy)
        )


class MotionFeed(PositionFeed):
    """The same for trackables."""

    def _objects(self, locations: list[Answer], projection: Projection) -> list[Answer]:
        """Return the motion of each trackable that one of these tags belongs to."""
        tags = [self._hub.answers.tags.find(location["provider_id"]) for location in locations]
        assets = self._hub.assets.of_tags(tag for tag in tags if tag is not None)
        wanted = [
            asset
            for asset in assets
            if allows(self._params.id, str(asset.trackable.id))
            and allows(self._params.trackable_id, str(asset.trackable.id))
        ]
        return self._hub.motions(wanted, projection)

    def _feature(self, found: Answer) -> Answer:
        return motion_feature(found)
