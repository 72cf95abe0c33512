"""The secret of the API nodes, from its file."""

from pathlib import Path

import pytest

from dropanchor_service.security.node_secret import node_secret_of
from dropanchor_service.settings.sources import SettingsError


def test_a_secret_is_one_line_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "node.secret"
    file.write_text("0123456789abcdef\n")
    assert node_secret_of(file) == b"0123456789abcdef"
    assert node_secret_of(None) is None


@pytest.mark.parametrize(
    "text", ["", "too short", "x" * 2000, "two lines of text\nare not one", "not ASCII: äöüäöüäöü"]
)
def test_what_cannot_be_a_secret_is_refused_with_how_to_make_one(text: str, tmp_path: Path) -> None:
    file = tmp_path / "node.secret"
    file.write_text(text)
    with pytest.raises(SettingsError, match="head -c 32 /dev/urandom"):
        node_secret_of(file)
    with pytest.raises(SettingsError, match="cannot be read: No such file"):
        node_secret_of(tmp_path / "nothing")
