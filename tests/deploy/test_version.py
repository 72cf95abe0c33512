"""All distributions and clients state the same version, and the changelog knows it."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from dropanchor_tag_client.host import VERSION
from release.version import DisagreementError, stated, version, write
from support.service import ROOT

HEADINGS = re.findall(r"^## \[(.+?)\](.*)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A folder with copies of the files that state the version."""
    for name, _ in stated():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def test_all_files_state_the_same_version() -> None:
    assert {found for _, found in stated()} == {version()} == {VERSION}


def test_no_other_file_of_a_distribution_states_it() -> None:
    """Wherever it stands it must be written for a release, so each place is listed."""
    words = ["git", "grep", "-l", "-F", version(), "--", "*.toml", "*.py", "*.json", "*.h", "*.ts", ":!tests"]
    found = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    assert set(found) - {"schemas/openapi.released.json"} <= {name for name, _ in stated()} | ALLOWED


ALLOWED = {"service/dropanchor_service/settings/events.py"}  # the network 10.1.0.0/16


def test_a_new_version_is_written_everywhere(copy: Path) -> None:
    write("12.0.1", copy)
    assert {found for _, found in stated(copy)} == {"12.0.1"}
    project = (copy / "service" / "pyproject.toml").read_text()
    assert '"dropanchor-tag-client[completion,simulator]==12.0.1"' in project
    assert project.count("12.0.1") == 4


def test_different_versions_are_named(copy: Path) -> None:
    file = copy / "tag_client" / "typescript" / "package.json"
    file.write_text(file.read_text().replace(f'"version": "{version()}"', '"version": "9.9.9"'))
    with pytest.raises(DisagreementError, match=r"package\.json: 9\.9\.9"):
        version(copy)


def test_what_is_no_version_is_refused(copy: Path) -> None:
    with pytest.raises(ValueError, match="no version"):
        write("next", copy)


def test_the_changelog_begins_with_what_is_unreleased_and_then_has_this_version() -> None:
    assert [name for name, _ in HEADINGS[:2]] == ["Unreleased", version()]


def test_every_release_in_the_changelog_has_a_date() -> None:
    assert all(re.fullmatch(r" - \d{4}-\d\d-\d\d", date) for name, date in HEADINGS if name != "Unreleased")
