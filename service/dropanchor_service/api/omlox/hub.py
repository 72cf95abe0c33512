"""What the routes and the WebSocket of the omlox interface share."""

from collections.abc import Sequence
from itertools import islice

from dropanchor_schemas.zones import Zone
from dropanchor_service.answers.answers import Answer, Answers
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.omlox.assets import Asset, Assets
from dropanchor_service.api.omlox.fences import Fences
from dropanchor_service.api.omlox.inside import Inside
from dropanchor_service.api.omlox.models import without_nulls
from dropanchor_service.api.omlox.own_properties import with_own
from dropanchor_service.api.omlox.places import Places, best_of
from dropanchor_service.api.omlox.projection import Projection
from dropanchor_service.events.store import EventStore
from dropanchor_service.store.items import NamedItems
from dropanchor_service.store.omlox_items import OmloxItems
from dropanchor_service.store.omlox_models import Properties
from dropanchor_service.store.tags import Tag

MAX_REASONS = 3  # in the text of a problem


class Hub:
    """The objects of omlox, read from the stores of the service. Any thread may use it."""

    def __init__(
        self, answers: Answers, zones: NamedItems[Zone], events: EventStore, items: OmloxItems, max_tags: int
    ) -> None:
        self.answers = answers
        self.events = events
        self.items = items
        self.max_tags = max_tags
        self.assets = Assets(answers, items)
        self.places = Places(answers, self.assets)
        self.fences = Fences(answers, zones, items)
        self.inside = Inside(events, self.places)

    def providers(self, tags: Sequence[Tag]) -> list[Answer]:
        """Return the `LocationProvider` of each tag."""
        return [self._provider(tag, state) for tag, state in zip(tags, self.places.states(tags), strict=True)]

    def trackables(self, assets: Sequence[Asset]) -> list[Answer]:
        """Return each `Trackable`."""
        tags = [self.assets.tags_of(asset.trackable) for asset in assets]
        states = iter(self.places.states([tag for group in tags for tag in group]))
        return [_trackable(asset, list(islice(states, len(group)))) for asset, group in zip(assets, tags, strict=True)]

    def motion(self, asset: Asset, locations: list[Answer]) -> Answer | None:
        """Return the `TrackableMotion` of the best of these locations, None if there is none."""
        best = best_of(locations)
        if best is None:
            return None
        values = asset.trackable.model_dump(mode="json", include={"id", "name", "extrusion", "properties"})
        return without_nulls(values | {"location": best})

    def motions(self, assets: Sequence[Asset], projection: Projection) -> list[Answer]:
        """Return the `TrackableMotion` of each of these trackables that has one."""
        tags = [tag for asset in assets for tag in self.assets.tags_of(asset.trackable)]
        by_trackable: dict[str, list[Answer]] = {}
        for location in self.places.of_tags(tags, projection):
            by_trackable.setdefault(location["trackables"][0], []).append(location)
        found = [self.motion(asset, by_trackable.get(str(asset.trackable.id), [])) for asset in assets]
        return [motion for motion in found if motion is not None]

    def no_location(self, tags: Sequence[Tag]) -> ProblemError:
        """Return the problem that says why none of these tags has a location."""
        states = self.places.states(tags)
        words = [f"The tag {state['tag']!r} is {state['state']}. {state['hint']}".strip() for state in states]
        detail = " ".join(words[:MAX_REASONS]) or "The trackable carries no tag: assign one in location_providers."
        return ProblemError(Kind.NO_LOCATION, detail, properties={"tags": states})

    def _provider(self, tag: Tag, state: Properties) -> Answer:
        stored = self.items.providers.all.get(tag.name)
        values = {} if stored is None else stored.model_dump(mode="json")
        named = {
            "id": tag.name,
            "type": "uwb",
            "name": self.answers.site.tag_settings(tag.name).name or tag.name,
            "properties": with_own(None if stored is None else stored.properties, state),
        }
        return without_nulls(values | named)


def _trackable(asset: Asset, states: list[Properties]) -> Answer:
    values = asset.trackable.model_dump(mode="json")
    return without_nulls(values | {"properties": with_own(asset.trackable.properties, {"tags": states})})
