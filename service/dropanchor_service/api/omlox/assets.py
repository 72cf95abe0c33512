"""Trackables: one for each tag, unless a client has assigned the tag to a trackable of its own."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple
from uuid import UUID

from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.omlox.ids import trackable_id
from dropanchor_service.store.omlox_items import OmloxItems
from dropanchor_service.store.omlox_models import Trackable
from dropanchor_service.store.tags import Tag


class Asset(NamedTuple):
    """A trackable, and the tag that it stands for; None: a client has made it."""

    trackable: Trackable
    own_tag: Tag | None


class Assets:
    """Any thread may use it."""

    def __init__(self, answers: Answers, items: OmloxItems) -> None:
        self._answers = answers
        self._items = items
        self._own_ids: dict[str, UUID] = {}
        self._claims: tuple[int, Mapping[str, UUID]] = (0, {})

    def all(self) -> list[Asset]:
        """Return every trackable."""
        claimed = self.claimed()
        own = [self._own(tag) for tag in self._answers.tags.listed() if tag.name not in claimed]
        return own + [Asset(trackable, None) for trackable in self._items.trackables.all.values()]

    def find(self, identifier: UUID) -> Asset | None:
        """Return the trackable with this id, None if there is none."""
        claimed = self.claimed()
        for tag in self._answers.tags.listed():
            if self.own_id(tag.name) == identifier:
                return None if tag.name in claimed else self._own(tag)
        made = self._items.trackables.all.get(str(identifier))
        return None if made is None else Asset(made, None)

    def of_tags(self, tags: Iterable[Tag]) -> list[Asset]:
        """Return the trackables that carry these tags."""
        claimed, made = self.claimed(), self._items.trackables.all
        found: dict[UUID, Asset] = {}
        for tag in tags:
            identifier = claimed.get(tag.name)
            if identifier is None:
                found[self.own_id(tag.name)] = self._own(tag)
            elif str(identifier) in made:
                found[identifier] = Asset(made[str(identifier)], None)
        return list(found.values())

    def id_of(self, tag: str) -> UUID:
        """Return the id of the trackable that carries a tag."""
        return self.claimed().get(tag) or self.own_id(tag)

    def tags_of(self, trackable: Trackable) -> list[Tag]:
        """Return the tags that a trackable carries."""
        found = [self._answers.tags.find(name) for name in trackable.location_providers or ()]
        return [tag for tag in found if tag is not None and not self._answers.tags.is_deleted(tag.row)]

    def own_id(self, tag: str) -> UUID:
        """Return the id of the trackable that stands for a tag as long as no other carries it."""
        if tag not in self._own_ids:
            self._own_ids[tag] = trackable_id(self._answers.site.site.id, tag)
        return self._own_ids[tag]

    def claimed(self) -> Mapping[str, UUID]:
        """Return the tags that clients have assigned to their own trackables, and which."""
        version, claims = self._claims
        stored = self._items.trackables
        if version != stored.version:
            version = stored.version
            claims = {name: one.id for one in stored.all.values() if one.id for name in one.location_providers or ()}
            self._claims = version, claims
        return claims

    def _own(self, tag: Tag) -> Asset:
        identifier = self.own_id(tag.name)
        stored = self._items.tag_trackables.all.get(tag.name) or Trackable(type="omlox")
        name = self._answers.site.tag_settings(tag.name).name or tag.name
        update = {"id": identifier, "name": name, "location_providers": [tag.name]}
        return Asset(stored.model_copy(update=update), tag)
