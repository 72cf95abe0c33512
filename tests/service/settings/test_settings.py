"""Settings come from a file, the environment and options. Errors name the source and the key."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from dropanchor_service.estimation.paper.parameters import TUNED, PaperParameters
from dropanchor_service.settings.sources import SettingsError, load_settings
from dropanchor_service.store import SiteStore


def write(folder: Path, text: str) -> Path:
    file = folder / "dropanchor.toml"
    file.write_text(text)
    return file


FULL = """
engine = "paper"
unknown_tags = "refuse"
max_tags = 100
[http]
port = 8081
[zenoh]
listen = ["tcp/0.0.0.0:7448"]
[site]
id = "yard"
declination_rad = 0.05
[[site.anchors]]
id = "7"
x = 1.5
[tags.forklift-1]
height_m = 1.2
start = { x = 1.0, y = 2.0, heading_rad = 0.5 }
[paper]
preset = "tuned"
parameters = { gate = 3.0, pair_spacing = 2 }
attitude = { yaw_time = 4.0 }
"""


def test_without_configuration_the_defaults_listen_on_the_loopback() -> None:
    settings = load_settings(environment={})
    assert (settings.http.host, settings.http.port) == ("127.0.0.1", 8080)
    assert settings.zenoh.listen == ("tcp/127.0.0.1:7447",)
    assert settings.unknown_tags == "accept"
    assert settings.paper.values() == PaperParameters()


def test_all_sections_of_a_file_are_read(tmp_path: Path) -> None:
    settings = load_settings(write(tmp_path, FULL), environment={})
    assert settings.site.anchors[0].x == 1.5
    assert settings.tags["forklift-1"].start is not None
    parameters = settings.paper.values()
    assert (parameters.gate, parameters.pair_spacing, parameters.blend) == (3.0, 2, TUNED.blend)
    assert parameters.attitude.yaw_time == 4.0


def test_options_override_the_environment_which_overrides_the_file(tmp_path: Path) -> None:
    environment = {"DROPANCHOR_HTTP__PORT": "8082", "DROPANCHOR_MAX_TAGS": "7", "DROPANCHOR_HTTP__HOST": "::1"}
    settings = load_settings(write(tmp_path, FULL), {"http": {"port": 8083}}, environment)
    assert (settings.http.port, settings.http.host, settings.max_tags) == (8083, "::1", 7)
    assert settings.unknown_tags == "refuse"


def test_lists_in_the_environment_are_json_or_separated_by_commas() -> None:
    for text in ('["tcp/a:1", "tcp/b:2"]', "tcp/a:1, tcp/b:2"):
        settings = load_settings(environment={"DROPANCHOR_ZENOH__CONNECT": text})
        assert settings.zenoh.connect == ("tcp/a:1", "tcp/b:2")


def test_a_string_is_accepted_as_a_number_only_in_the_environment(tmp_path: Path) -> None:
    environment = {"DROPANCHOR_SITE__DECLINATION_RAD": "0.05", "DROPANCHOR_SITE__ID": "7", "DROPANCHOR_INSECURE": "1"}
    settings = load_settings(environment=environment)
    assert (settings.site.declination_rad, settings.site.id, settings.insecure) == (0.05, "7", True)
    with pytest.raises(SettingsError, match=r"site\.declination_rad: a number was expected, not a text"):
        load_settings(write(tmp_path, '[site]\ndeclination_rad = "0.05"'), environment={})


def test_unrelated_variables_with_the_prefix_are_ignored() -> None:
    assert load_settings(environment={"DROPANCHOR_DATA": "/somewhere"}) == load_settings(environment={})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[http]\nport = 99999", ["http.port", "less than or equal to 65535"]),
        ("[http]\nprot = 1", ["http.prot is not a setting", "did you mean port?"]),
        ("[tags.a]\nheigth_m = 1", ["tags.a.heigth_m is not a setting", "did you mean height_m?"]),
        ("[[site.anchors]]\nid = '1'\nxx = 1", ["site.anchors.0.xx is not a setting", "did you mean x?"]),
        (
            "[tag_defaults.start]\nx = 1\ny = 2\nheading = 1",
            ["tag_defaults.start.heading", "did you mean heading_rad?"],
        ),
        ("[http]\ncors_origins = ['board.example']", ["http.cors_origins.0", "an origin such as https://"]),
        ("[htp]\nport = 1", ["htp is not a setting", "did you mean http?"]),
        ('engine = "magic"', ["engine", "'paper'"]),
        ('unknown_tags = "maybe"', ["unknown_tags", "'accept', 'quarantine' or 'refuse'"]),
        ("max_tags = 0", ["max_tags", "greater than or equal to 1"]),
        ('[zenoh]\nlisten = "7447"', ["zenoh.listen.0", "tcp/127.0.0.1:7447"]),
        ('[[site.anchors]]\nid = "7"\nx = "left"', ["site.anchors.0.x", "a number was expected"]),
        ('[[site.anchors]]\nid = "7"\n[[site.anchors]]\nid = "7"', ["site", "share one number"]),
        ("[tags.a]\nrange_scale = 0", ["tags.a.range_scale", "greater than 0"]),
        ("[tags.a.start]\nx = 1.0", ["tags.a.start.y", "required"]),
        (f"[tags.{'a' * 65}]", ["tags", "1 to 64 characters"]),
        ("[paper]\nparameters = { gat = 3.0 }", ["paper", "gat is not a parameter", "did you mean gate?"]),
        ('[tags."*"]\nheight_m = 1.0', ["tags.*: '*' would be", "not a pattern", "give each tag its own"]),
        ('[tags."forklift-*"]', ["tags.forklift-*", "not a pattern"]),
        ("max_tags = 1\n[tags.a]\n[tags.b]", ["max_tags is 1, but 2 tags are listed"]),
        ("port = ", ["is not TOML", "Invalid value"]),
    ],
)
def test_an_error_names_the_file_the_key_and_what_is_expected(tmp_path: Path, text: str, words: list[str]) -> None:
    file = write(tmp_path, text)
    with pytest.raises(SettingsError) as caught:
        load_settings(file, environment={})
    for word in [str(file), *words]:
        assert word in str(caught.value)


def test_all_errors_are_reported_together_each_with_its_source(tmp_path: Path) -> None:
    with pytest.raises(SettingsError) as caught:
        load_settings(write(tmp_path, "max_tags = 0"), {"http": {"port": -1}}, {"DROPANCHOR_ENGINE": "magic"})
    lines = str(caught.value).splitlines()
    assert [line.split(":")[0].rsplit("/")[-1] for line in sorted(lines)] == [
        "dropanchor.toml",
        "the command line",
        "the environment",
    ]


def test_an_error_does_not_repeat_the_value_which_may_be_a_secret() -> None:
    with pytest.raises(SettingsError) as caught:
        load_settings(environment={"DROPANCHOR_HTTP__PORT": "hunter2"})
    assert "hunter2" not in str(caught.value)


def test_an_unreadable_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"missing\.toml: cannot be read: No such file"):
        load_settings(tmp_path / "missing.toml", environment={})


def test_settings_are_immutable() -> None:
    with pytest.raises(ValidationError):
        load_settings(environment={}).max_tags = 3


def test_a_tag_gets_the_defaults_unless_its_own_table_says_otherwise(tmp_path: Path) -> None:
    text = """
[tag_defaults]
height_m = 1.2
speed_max_mps = 3.0
start = { x = 1.0, y = 2.0 }
[tags.cart]
height_m = 0.0
[tags.drone]
start = { x = 5.0, y = 6.0 }
"""
    settings = load_settings(write(tmp_path, text), environment={})
    store = SiteStore(settings.site, settings.listed_tags, tag_defaults=settings.tag_defaults)
    cart, drone, other = (store.tag_settings(name) for name in ("cart", "drone", "other"))
    assert (cart.height_m, drone.height_m, other.height_m) == (0.0, 1.2, 1.2)
    assert {tag.speed_max_mps for tag in (cart, drone, other)} == {3.0}
    assert [tag.start and tag.start.x for tag in (cart, drone, other)] == [1.0, 5.0, 1.0]
