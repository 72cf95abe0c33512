"""What was set over REST holds; what nobody touched follows the settings file, value by value."""

import json
import logging
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_schemas.site import Anchor, Georeference, RemoteSettings, Site, StartPose, TagSettings
from dropanchor_service.store import SiteStore
from dropanchor_service.store.site_values import Configured, SiteDocument, nothing_set, values_in

ONE, TWO = Anchor(id="1", x=1.0), Anchor(id="2", y=2.0)
YARD = Site(id="yard", name="Yard", declination_rad=0.1, anchors=[ONE, TWO])
TAGS = {"cart": TagSettings(height_m=1.0, name="Cart"), "lift": TagSettings(height_m=2.0)}
OTHER_YARD = Site(
    id="yard", name="Other", declination_rad=0.2, anchors=[Anchor(id="1", x=9.0), Anchor(id="2", y=9.0), Anchor(id="3")]
)
OTHER_TAGS = {"cart": TagSettings(height_m=7.0, name="New"), "lift": TagSettings(height_m=8.0), "new": TagSettings()}


def store_in(folder: Path, site: Site = YARD, tags: dict[str, TagSettings] = TAGS) -> SiteStore:
    return SiteStore(site, tags, folder)


def restarted(folder: Path) -> SiteStore:
    """Return the store after a restart with another settings file."""
    return store_in(folder, OTHER_YARD, OTHER_TAGS)


def saved(folder: Path) -> dict[str, object]:
    found = json.loads((folder / "site.json").read_bytes())
    return {name: value for name, value in found.items() if value and name != "format"}


def test_what_nobody_touched_follows_the_settings_file_and_what_was_set_holds(tmp_path: Path) -> None:
    store = store_in(tmp_path)
    store.set_anchor(Anchor(id="1", x=5.0))
    store.set_tag("cart", TagSettings(height_m=1.5, name="Cart"))
    store.set_site(store.site.model_copy(update={"declination_rad": 0.5}))
    assert saved(tmp_path) == {
        "site": {"id": "yard", "declination_rad": 0.5},
        "anchors": {"1": {"id": "1", "x": 5.0}},
        "tags": {"cart": {"height_m": 1.5}},
    }
    after = restarted(tmp_path)
    assert (after.site.name, after.site.declination_rad) == ("Other", 0.5)
    assert [(one.id, one.x, one.y) for one in after.site.anchors] == [("1", 5.0, 0.0), ("2", 0.0, 9.0), ("3", 0.0, 0.0)]
    assert (after.tags["cart"].height_m, after.tags["cart"].name) == (1.5, "New")
    assert (after.tags["lift"].height_m, list(after.tags)) == (8.0, ["cart", "lift", "new"])


def test_a_value_that_is_put_as_it_is_configured_is_given_back(tmp_path: Path) -> None:
    store = store_in(tmp_path)
    store.set_site(Site(id="yard", name="Hof", anchors=[Anchor(id="1", x=5.0)]))
    store.set_tag("cart", TagSettings(height_m=1.5))
    store.set_tag("cart", TAGS["cart"])
    store.set_site(YARD)
    assert saved(tmp_path) == {"site": {"id": "yard"}, "tags": {"cart": {}}}
    after = restarted(tmp_path)
    assert (after.site, after.tags) == (OTHER_YARD, OTHER_TAGS)


def test_what_was_removed_stays_removed_until_it_is_put_again(tmp_path: Path) -> None:
    store = store_in(tmp_path)
    store.remove_anchor("2")
    store.remove_tag("lift", 5)
    after = restarted(tmp_path)
    assert ([one.id for one in after.site.anchors], list(after.tags)) == (["1", "3"], ["cart", "new"])
    after.set_anchor(Anchor(id="2", y=9.0))
    after.set_tag("lift", TagSettings(height_m=8.0))
    assert saved(tmp_path) == {"site": {"id": "yard"}, "tags": {"lift": {}}}


@pytest.mark.parametrize(
    ("configured", "expected"), [([], ["7"]), ([TWO], ["2"])], ids=["none configured", "configured"]
)
def test_the_anchor_of_the_first_range_gives_way_to_configured_ones(
    tmp_path: Path, configured: list[Anchor], expected: list[str]
) -> None:
    nowhere = Site(id="yard")
    assert store_in(tmp_path, nowhere).bind_first("7")
    after = store_in(tmp_path, nowhere.model_copy(update={"anchors": configured}))
    assert [one.id for one in after.site.anchors] == expected


def test_a_first_range_makes_a_new_origin_after_all_anchors_were_removed(tmp_path: Path) -> None:
    for site in (YARD, Site(id="yard")):
        store = store_in(tmp_path, site)
        for anchor in store.site.anchors:
            store.remove_anchor(anchor.id)
        assert store.bind_first("9")
        assert [one.id for one in store_in(tmp_path, site).site.anchors] == ["9"]


OLDER = SiteDocument(
    site=YARD.model_copy(update={"name": "Set", "anchors": [ONE, Anchor(id="2", y=5.0)]}),
    tags={"cart": TagSettings(height_m=1.5, name="Cart"), "lift": TAGS["lift"], "mine": TagSettings(height_m=3.0)},
    remote={"cart": RemoteSettings(imu_hz=50.0)},
    deleted_ns={"gone": 5},
)


def test_of_an_older_file_what_equals_the_settings_is_configured_and_the_rest_is_set(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "site.json").write_text(OLDER.model_dump_json())
    with caplog.at_level(logging.INFO):
        assert store_in(tmp_path).document == OLDER
    assert "['2', 'cart', 'mine'] count as set over REST" in caplog.text
    after = restarted(tmp_path)  # what was found first holds, whatever the settings file says by now
    assert saved(tmp_path)["tags"] == {"cart": {"height_m": 1.5}, "lift": {}, "mine": {"height_m": 3.0}}
    assert (after.site.name, after.site.declination_rad) == ("Set", 0.2)
    assert [(one.id, one.x, one.y) for one in after.site.anchors] == [("1", 9.0, 0.0), ("2", 0.0, 5.0), ("3", 0.0, 0.0)]
    assert (after.tags["cart"].height_m, after.tags["cart"].name, after.tags["lift"].height_m) == (1.5, "New", 8.0)
    assert (after.remote_settings("cart").imu_hz, after.was_deleted_after("gone", 4)) == (50.0, True)


def test_an_anchor_that_an_older_file_does_not_have_stays_removed_and_fields_that_it_does_not_know_are_configured(
    tmp_path: Path,
) -> None:
    document = {"site": {"id": "yard", "anchors": [{"id": "1", "x": 1.0}]}, "tags": {"cart": {"name": "Cart"}}}
    (tmp_path / "site.json").write_text(json.dumps(document))
    store = store_in(tmp_path)
    assert ([one.id for one in store.site.anchors], store.site.name, store.tags["cart"]) == (
        ["1"],
        "Yard",
        TAGS["cart"],
    )


def test_an_older_file_that_cannot_be_replaced_is_used_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "site.json").write_text(OLDER.model_dump_json())

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("dropanchor_service.store.site.write_with_copy", full)
    assert store_in(tmp_path).document == OLDER


ANCHORS = st.lists(
    st.builds(Anchor, id=st.sampled_from("123"), x=st.sampled_from([0.0, 1.0])), unique_by=lambda a: a.id
)
SITES = st.builds(
    Site,
    name=st.sampled_from(["", "a"]),
    declination_std_rad=st.sampled_from([None, 0.1]),
    georeference=st.sampled_from([None, Georeference(lat=1.0, lon=2.0), Georeference(lat=1.0, lon=2.0, alt_m=3.0)]),
    anchors=ANCHORS,
)
SETTINGS = st.builds(
    TagSettings, height_m=st.sampled_from([0.0, 1.0]), start=st.sampled_from([None, StartPose(x=1.0, y=2.0)])
)


@given(SITES, SITES, SETTINGS, SETTINGS, st.sampled_from([None, Anchor(id="9")]))
def test_whatever_is_set_is_in_force_after_a_restart(
    configured: Site, wanted: Site, of_tag: TagSettings, wanted_of_tag: TagSettings, found: Anchor | None
) -> None:
    settings = Configured(configured, {"cart": of_tag}, TagSettings())
    before = nothing_set("default").model_copy(update={"found": found})
    values = before.with_site(wanted, settings).with_tag("cart", wanted_of_tag, settings)
    after = values_in(values.to_bytes(), settings)[0].in_force(settings)
    assert {one.id: one for one in after.site.anchors} == {one.id: one for one in wanted.anchors}
    assert after.site.model_copy(update={"anchors": []}) == wanted.model_copy(update={"anchors": []})
    assert after.tags == {"cart": wanted_of_tag}
