"""The settings of a site in force, value by value: what was set over REST, and else what is configured."""

from collections.abc import Iterator, Sequence

from dropanchor_schemas.settings_values import HeldValue, SettingSource, SettingValue
from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_service.settings.layers import Layer, as_json, fields_of, held_in, setting
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.site_values import Configured, SetValues

_TAGS, _DEFAULTS = "tags", "tag_defaults"


def values_of_site(store: SiteStore) -> list[SettingValue]:
    """Return the values of the site, its anchors, the tags and their defaults; those that were set over REST first."""
    document, values, configured, layers = store.document, store.values, store.configured, store.layers
    found = [
        *_of_site(document.site, values.site, configured.site, layers),
        *_anchors(values, configured, layers),
        *_tags(store, values, configured),
        *fields_of(configured.defaults, layers, (_DEFAULTS,)),
    ]
    return sorted(found, key=lambda value: value.source != "rest")


def _of_site(site: Site, own: Site, configured: Site, layers: Sequence[Layer]) -> Iterator[SettingValue]:
    for value in fields_of(configured, layers, ("site",)):
        name = value.path[-1]
        if name in own.model_fields_set - {"id"}:
            yield _set_over(value, getattr(site, name))
        elif name != "anchors":
            yield value


def _anchors(values: SetValues, configured: Configured, layers: Sequence[Layer]) -> Iterator[SettingValue]:
    held = held_in(layers, ("site", "anchors"))[:1]
    first: SettingSource | None = None if configured.site.anchors else "first_range"
    below = {
        anchor.number: setting(
            ("site", "anchors", anchor.id), anchor, [_with(one, anchor) for one in held], above=first
        )
        for anchor in configured.anchors(values.found)
    }
    changed = {Anchor(id=name).number: anchor for name, anchor in values.anchors.items()}
    for number, value in below.items():
        yield _set_over(value, changed[number]) if number in changed else value
    for number, anchor in changed.items():
        if number not in below and anchor is not None:
            yield setting(("site", "anchors", anchor.id), anchor, [], above="rest")


def _with(held: HeldValue, value: object) -> HeldValue:
    """Return the part of a held value that is of one anchor or tag."""
    return held.model_copy(update={"value": as_json(value)})


def _tags(store: SiteStore, values: SetValues, configured: Configured) -> Iterator[SettingValue]:
    for name in values.deleted_ns.keys() & configured.tags.keys():
        held = [_with(one, configured.tags[name]) for one in held_in(store.layers, (_TAGS, name))[:1]]
        yield setting((_TAGS, name), None, held, above="rest")
    for name in store.tags:
        for value in values_of_tag(store, name):
            if value.source == "rest" or value.at[-3:-1] == [_TAGS, name]:
                yield value


def values_of_tag(store: SiteStore, name: str) -> Iterator[SettingValue]:
    """Yield every value of a tag, also those that it has from the defaults of all tags or as its model has them."""
    own = store.values.tags.get(name, TagSettings())
    for value in fields_of(store.configured.tag(name), store.layers, (_TAGS, name), (_DEFAULTS,)):
        field = value.path[-1]
        yield _set_over(value, getattr(own, field)) if field in own.model_fields_set else value


def _set_over(value: SettingValue, now: object) -> SettingValue:
    """Return what was set over REST in place of a configured value."""
    hidden = HeldValue(**{name: getattr(value, name) for name in HeldValue.model_fields})
    return setting(tuple(value.path), now, [], above="rest").model_copy(update={"hides": [hidden, *value.hides]})
