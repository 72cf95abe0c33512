"""`dropanchor settings --show`, and the same values over REST."""

import json
from pathlib import Path
from typing import Any

import pytest

from dropanchor_schemas.site import Anchor, TagSettings
from dropanchor_service.answers.answers import Answers
from dropanchor_service.cli import main
from dropanchor_service.persistence.site import open_sites
from dropanchor_service.settings.sources import load_settings
from dropanchor_service.store import LatestPoses, SiteStore
from support.api import ApiBench, ask

ONLY = """
[http]
port = 8082
[site]
id = "yard"
name = "Yard"
anchors = [{ id = "1", z = 2.5 }, { id = "2" }]
[tag_defaults]
height_m = 1.2
[tags."a.b"]
name = "AB"
[tags.cart]
range_bias_m = 0.2
"""
SEVERAL = """
[http]
port = 8082
[tag_defaults]
height_m = 1.2
[sites.yard]
site = { name = "Yard", anchors = [{ id = "1", z = 2.5 }, { id = "2" }] }
tags = { "a.b" = { name = "AB" }, cart = { range_bias_m = 0.2 } }
[sites.annexe]
tag_defaults = { height_m = 3.0 }
"""


def change(store: SiteStore) -> None:
    store.set_anchor(Anchor(id="1", x=50.0, z=2.5))
    store.remove_anchor("2")
    store.set_tag("cart", store.tag_settings("cart").model_copy(update={"height_m": 1.5}))
    store.remove_tag("a.b", 5)
    store.set_site(store.site.model_copy(update={"name": "Hof"}))


def prepared(folder: Path, text: str) -> list[str]:
    """Write a settings file and a data folder. Return the options of the command."""
    file = folder / "yard.toml"
    file.write_text(text)
    options = {"data_dir": str(folder / "data")}
    change(open_sites(load_settings(file, options, {}))[0].store)
    return ["settings", "--show", "--config", str(file), "--data-dir", options["data_dir"]]


def shown(capsys: pytest.CaptureFixture[str], words: list[str]) -> dict[tuple[str | None, ...], Any]:
    """Return value, source and what is hidden of each setting, by site and path."""
    assert main([*words, "--json"]) == 0
    return {
        (one["site"], *one["path"]): (
            one["value"],
            one["source"],
            [(two["value"], two["source"]) for two in one["hides"]],
        )
        for one in json.loads(capsys.readouterr().out)["settings"]
    }


@pytest.mark.parametrize("text", [ONLY, SEVERAL], ids=["an only site", "several sites"])
def test_each_value_comes_with_its_source_and_what_it_hides(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    words = prepared(tmp_path, text)
    below = "" if text == ONLY else "SITES__YARD__"
    monkeypatch.setenv(f"DROPANCHOR_{below}SITE__NAME", "Env")
    before = {path: path.read_bytes() for path in (tmp_path / "data").rglob("*") if path.is_file()}
    found = shown(capsys, [*words, "--port", "8083"])
    one = {"id": "1", "x": 0.0, "y": 0.0, "z": 2.5, "facing_rad": None, "mirrors_behind": True}
    assert found[None, "http", "port"] == (8083, "command_line", [(8082, "file"), (8080, "default")])
    assert found[None, "ingest", "period_ms"] == (20.0, "default", [])
    assert found["yard", "site", "name"] == ("Hof", "rest", [("Env", "environment"), ("Yard", "file"), ("", "default")])
    moved, source, hides = found["yard", "site", "anchors", "1"]
    assert (moved["x"], source, hides[0]) == (50.0, "rest", (one, "file"))
    assert found["yard", "site", "anchors", "2"][:2] == (None, "rest")
    assert found["yard", "tags", "cart", "height_m"] == (1.5, "rest", [(1.2, "file"), (0.0, "default")])
    assert found["yard", "tags", "cart", "range_bias_m"] == (0.2, "file", [(0.0, "default")])
    removed = found["yard", "tags", "a.b"]
    assert (removed[:2], removed[2][0][0]["name"]) == ((None, "rest"), "AB")
    assert found["yard", "tag_defaults", "height_m"][:2] == (1.2, "file")
    if text == SEVERAL:
        assert found["annexe", "tag_defaults", "height_m"] == (3.0, "file", [(1.2, "file"), (0.0, "default")])
    assert {path: path.read_bytes() for path in (tmp_path / "data").rglob("*") if path.is_file()} == before


def test_the_lines_name_the_file_and_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = prepared(tmp_path, ONLY)
    assert main([*words, "--set-only"]) == 0
    lines, file = capsys.readouterr().out.splitlines(), tmp_path / "yard.toml"
    assert f"tags.cart.height_m = 1.5  [set over REST, hides 1.2: {file} tag_defaults.height_m]" in lines
    assert f"http.port = 8082  [{file} http.port]" in lines
    assert any(line.startswith('tags."a.b" = not set  [set over REST, hides {"name": "AB"') for line in lines)
    assert not any("default]" in line for line in lines)


@pytest.mark.parametrize("damage", ["{", '{"format": 3}'])
def test_a_site_that_cannot_be_read_is_named_and_the_settings_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture, damage: str
) -> None:
    words = prepared(tmp_path, ONLY)
    (tmp_path / "data" / "site.json").write_text(damage)
    assert shown(capsys, words)["yard", "site", "name"][:2] == ("Hof", "rest")  # its last good copy
    assert "site.json cannot be read" in caplog.text


def test_settings_that_are_wrong_end_the_command_with_their_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "yard.toml").write_text("[http]\nporrt = 1")
    assert main(["settings", "--show", "--config", str(tmp_path / "yard.toml")]) == 2
    assert "http.porrt is not a setting; did you mean port?" in capsys.readouterr().err


def test_rest_lists_the_values_of_a_site_and_what_it_hides_can_be_put_back(tmp_path: Path) -> None:
    (tmp_path / "yard.toml").write_text(ONLY)
    store = open_sites(load_settings(tmp_path / "yard.toml", environment={}))[0].store
    change(store)
    bench = ApiBench(Answers(store, open_sites(load_settings(environment={}))[0].tags, LatestPoses()))
    bench.answers.tags.register("cart")
    app = bench.app()

    def set_values(**query: Any) -> list[dict[str, Any]]:
        answer = ask(app, "GET", "/api/v1/settings", params={"source": "rest", **query}).json()
        assert answer["total"] == len(answer["values"]) or "limit" in query
        found: list[dict[str, Any]] = answer["values"]
        return found

    assert len(set_values(limit=2)) == 2
    assert {tuple(one["path"]) for one in set_values()} == {
        *(("site", "name"), ("site", "anchors", "1"), ("site", "anchors", "2"), ("tags", "a.b")),
        ("tags", "cart", "height_m"),
    }
    of_cart = {value["path"][2]: value for value in set_values(tag="cart", source=["rest", "file", "default"])}
    assert of_cart.keys() == TagSettings.model_fields.keys()
    sources = [of_cart[name]["source"] for name in ("height_m", "range_bias_m", "name")]
    assert sources == ["rest", "file", "default"]
    assert ask(app, "GET", "/api/v1/settings?tag=nobody").status_code == 404
    for value in set_values():
        hidden = value["hides"][0]["value"]
        match value["path"]:
            case ["site", "anchors", anchor]:
                answer = ask(app, "PUT", f"/api/v1/anchors/{anchor}", json=hidden)
            case ["site", name]:
                answer = ask(app, "PUT", "/api/v1/site", json=ask(app, "GET", "/api/v1/site").json() | {name: hidden})
            case ["tags", tag]:
                answer = ask(app, "PUT", f"/api/v1/tags/{tag}/settings", json=hidden)
            case ["tags", tag, name]:
                body = store.tag_settings(tag).model_dump() | {name: hidden}
                answer = ask(app, "PUT", f"/api/v1/tags/{tag}/settings", json=body)
        assert answer.status_code == 200
    assert set_values() == []
    assert store.tags == {
        "cart": TagSettings(height_m=1.2, range_bias_m=0.2),
        "a.b": TagSettings(height_m=1.2, name="AB"),
    }
