"""Several sites have a table each, and a table that contradicts another is refused with a sentence."""

from pathlib import Path

import pytest

from dropanchor_schemas.site import Anchor
from dropanchor_service.persistence.site import open_sites
from dropanchor_service.settings.many_sites import MOST_WITH_FILES, refuse_too_many_sites
from dropanchor_service.settings.quota import Quota
from dropanchor_service.settings.sources import SettingsError, load_settings

FILE = """
max_unconfirmed_tags = 7
[tag_defaults]
height_m = 1.0
range_scale = 1.1
[sites.north.site]
name = "North yard"
anchors = [{ id = "1" }]
[sites.north.tags.cart]
mount_angle_rad = 0.5
[sites.south]
max_tags = 3
unknown_tags = "refuse"
[sites.south.tag_defaults]
height_m = 2.0
[sites."Lager Süd"]
"""


def file_with(folder: Path, text: str) -> Path:
    file = folder / "sites.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_each_site_gets_its_table_and_the_top_level_for_the_rest(tmp_path: Path) -> None:
    settings = load_settings(file_with(tmp_path, f'data_dir = "{tmp_path}"\n{FILE}'), environment={})
    sites = open_sites(settings)
    assert [site.id for site in sites] == ["north", "south", "Lager Süd"]
    north, south, last = sites
    assert (north.store.site.name, north.quota) == ("North yard", Quota("accept", 7, 20_000))
    assert (north.store.tag_settings("cart").mount_angle_rad, north.store.tag_settings("cart").height_m) == (0.5, 1.0)
    assert south.store.tag_settings("any").range_scale == 1.1
    assert (south.store.tag_settings("any").height_m, south.quota) == (2.0, Quota("refuse", 7, 3))
    for site in (south, last):
        site.store.set_anchor(Anchor(id="7"))
    again = open_sites(settings)
    assert [len(site.store.site.anchors) for site in again] == [1, 1, 1]
    assert (tmp_path / "sites" / "Lager%20S%C3%BCd" / "site.json").exists()


def test_one_site_needs_no_table_of_its_own() -> None:
    only = open_sites(load_settings(options={"site": {"id": "yard"}, "max_tags": 5}, environment={})).only
    assert only is not None
    assert (only.id, only.quota.max_tags) == ("yard", 5)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('[site]\nid = "a"\n[sites.b]', "[site] and [tags] are of an only site: move them into the tables of [sites]"),
        ('[sites.a.site]\nid = "b"', "[sites.a] has the id 'b': leave out `id`, which is 'a'"),
        ("[sites.a]\nmax_tags = 1\n[sites.a.tags.x]\n[sites.a.tags.y]", "max_tags of the site 'a' is 1, but 2 tags"),
        ('[sites."a*"]', "sites.a*: 'a*' would be the id of one"),
        (
            '[sites.a]\noidc_scopes = { read = "yard-a" }',
            "oidc_scopes of the site 'a' needs a provider: set [security.oidc]",
        ),
        ("[sites.a]\nmax_tag = 1", "sites.a.max_tag is not a setting; did you mean max_tags?"),
    ],
)
def test_a_table_that_contradicts_another_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(SettingsError) as refused:
        load_settings(file_with(tmp_path, text), environment={})
    assert sentence in str(refused.value)


def test_a_history_and_recordings_are_for_a_limited_number_of_sites(tmp_path: Path) -> None:
    text = f'data_dir = "{tmp_path}"\n[recording]\nenabled = true\n'
    sites = [f"[sites.s{number}]\n" for number in range(MOST_WITH_FILES + 1)]
    refuse_too_many_sites(load_settings(file_with(tmp_path, text + "".join(sites[1:])), environment={}))
    with pytest.raises(SettingsError) as refused:
        refuse_too_many_sites(load_settings(file_with(tmp_path, text + "".join(sites)), environment={}))
    for key in ("history", "recording"):
        assert f"{key} is for up to 100 sites, and there are 101: set {key}.enabled = false" in str(refused.value)
    off = text.replace("true", "false") + "[history]\nenabled = false\n"
    refuse_too_many_sites(load_settings(file_with(tmp_path, off + "".join(sites)), environment={}))
