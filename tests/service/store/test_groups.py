"""The settings of a tag, or the defaults, name its group."""

from pathlib import Path

from dropanchor_schemas.site import Anchor, Site, TagSettings
from dropanchor_service.store import SiteStore


def test_a_tag_without_settings_is_in_the_group_of_the_defaults() -> None:
    store = SiteStore(Site(), {"a": TagSettings(group="carts")}, tag_defaults=TagSettings(group="new"))
    assert store.groups.are_in(["a", "b"], ["new"]) == [False, True]
    store.set_tag("b", TagSettings(group="carts"))
    assert store.groups.are_in(["a", "b"], ["carts"]) == [True, True]


def test_groups_are_equal_until_a_tag_changes_its_group(tmp_path: Path) -> None:
    store = SiteStore(Site(), {"a": TagSettings(group="carts")}, tmp_path)
    before = store.groups
    store.set_anchor(Anchor(id="one"))
    store.set_tag("a", TagSettings(group="carts", height_m=1.0))
    assert store.groups == before
    store.set_tag("a", TagSettings(group="forklifts"))
    assert store.groups != before
