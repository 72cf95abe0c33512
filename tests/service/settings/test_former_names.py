"""Settings under their former names are understood, and a warning says what they are called now."""

import logging
from pathlib import Path

import pytest

from dropanchor_service.settings.former_names import FORMER
from dropanchor_service.settings.sources import SettingsError, load_settings

FILE = """unproven_tags = 3
[history]
most_mib = 10
[recording]
most_mib = 20
[events]
most_mib = 30
[sites.north]
unproven_tags = 7
"""


def test_former_names_in_a_file_set_what_they_are_called_now(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "yard.toml"
    file.write_text(FILE)
    with caplog.at_level(logging.WARNING):
        settings = load_settings(file, environment={})
    assert (settings.max_unconfirmed_tags, settings.sites["north"].max_unconfirmed_tags) == (3, 7)
    assert [section.max_mib for section in (settings.history, settings.recording, settings.events)] == [10, 20, 30]
    assert len(caplog.messages) == len(FORMER)
    assert f"{file}: sites.north.unproven_tags is called max_unconfirmed_tags now" in caplog.text


def test_a_former_name_in_the_environment_overrides_the_file(caplog: pytest.LogCaptureFixture, tmp_path: Path) -> None:
    file = tmp_path / "yard.toml"
    file.write_text("max_unconfirmed_tags = 3\n[history]\nmax_mib = 10\n")
    given = {"DROPANCHOR_UNPROVEN_TAGS": "5", "DROPANCHOR_HISTORY__MOST_MIB": "50"}
    settings = load_settings(file, environment=given)
    assert (settings.max_unconfirmed_tags, settings.history.max_mib) == (5, 50)
    assert "the environment: history.most_mib is called max_mib now" in caplog.text


def test_of_both_names_the_present_one_holds_and_present_names_are_not_mentioned(
    caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    file = tmp_path / "yard.toml"
    file.write_text("[history]\nmax_mib = 10\n")
    assert load_settings(file, environment={}).history.max_mib == 10
    assert caplog.messages == []
    file.write_text("[history]\nmax_mib = 10\nmost_mib = 20\n")
    assert load_settings(file, environment={}).history.max_mib == 10


def test_a_wrong_value_under_a_former_name_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "yard.toml"
    file.write_text("unproven_tags = -1\nsites = 4\n")
    with pytest.raises(SettingsError, match="max_unconfirmed_tags"):
        load_settings(file, environment={})
