"""Create, change and delete trackables. What belongs to a tag itself, its name, becomes a setting of the tag."""

from pydantic import ValidationError

from dropanchor_schemas.site import TagSettings
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.omlox.assets import Asset
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.own_properties import without_own
from dropanchor_service.api.omlox.parameters import exists_already, require_id
from dropanchor_service.api.routes.parameters import saving
from dropanchor_service.api.routes.tags import register_tag
from dropanchor_service.store.items import FullError, Item, NamedItems
from dropanchor_service.store.omlox_models import Trackable
from dropanchor_service.store.tags import Tag


def add(hub: Hub, trackable: Trackable) -> Asset:
    """Save a new trackable. Raises ProblemError."""
    assert trackable.id is not None
    if hub.assets.find(trackable.id) is not None:
        raise exists_already("trackable", trackable.id)
    return _save(hub, trackable)


def change(hub: Hub, asset: Asset, trackable: Trackable) -> Asset:
    """Save a trackable in place of another one. Raises ProblemError."""
    identifier = asset.trackable.id
    assert identifier is not None
    require_id(identifier, trackable.id)
    if asset.own_tag is None:
        return _save(hub, trackable.model_copy(update={"id": identifier}))
    tag = asset.own_tag
    if trackable.location_providers not in (None, [tag.name]):
        raise ProblemError(
            Kind.STANDS_FOR_A_TAG, f"It carries the tag {tag.name!r} alone: create another trackable for several tags."
        )
    update = {"id": None, "name": None, "location_providers": None, "properties": without_own(trackable.properties)}
    save(hub.items.tag_trackables, tag.name, trackable.model_copy(update=update))
    name_tag(hub, tag.name, trackable.name)
    return hub.assets.of_tags([tag])[0]


def remove(hub: Hub, asset: Asset) -> None:
    """Delete a trackable that a client has created. Raises ProblemError."""
    if asset.own_tag is not None:
        raise ProblemError(
            Kind.STANDS_FOR_A_TAG,
            f"It stands for the tag {asset.own_tag.name!r}. Delete the provider {asset.own_tag.name!r} to delete both.",
        )
    forget(hub.items.trackables, str(asset.trackable.id))


def name_tag(hub: Hub, tag: str, name: str | None) -> Tag:
    """Set the display name of a tag, and register it if it is unknown. Raises ProblemError."""
    settings = hub.answers.site.tag_settings(tag)
    shown = "" if name in (None, tag) else name
    if settings.name != shown or hub.answers.tags.find(tag) is None:
        try:
            named = TagSettings.model_validate(settings.model_dump() | {"name": shown})
        except ValidationError as error:
            raise ProblemError(Kind.INVALID_REQUEST, f"body.name: {error.errors()[0]['msg']}.") from error
        register_tag(hub.answers, tag, named, hub.max_tags, lambda current: current == settings)
    return hub.answers.tags.register(tag)


def save(items: NamedItems[Item], name: str, item: Item) -> None:
    """Save what clients say about an object. Raises ProblemError."""
    with saving():
        try:
            items.put(name, item)
        except FullError as error:
            raise ProblemError(Kind.ITEMS_FULL, f"There are {len(items.all)} already. Delete one first.") from error


def forget(items: NamedItems[Item], name: str) -> None:
    """Delete what clients have said about an object, if they have. Raises ProblemError."""
    with saving():
        if name in items.all:
            items.remove(name)


def _save(hub: Hub, trackable: Trackable) -> Asset:
    claims = hub.assets.claimed()
    for tag in trackable.location_providers or ():
        if claims.get(tag, trackable.id) != trackable.id:
            raise ProblemError(
                Kind.PROVIDER_ASSIGNED, f"The trackable {claims[tag]} carries {tag!r}: take it from there first."
            )
    kept = trackable.model_copy(update={"properties": without_own(trackable.properties)})
    save(hub.items.trackables, str(trackable.id), kept)
    return Asset(kept, None)
