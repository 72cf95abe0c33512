"""A file name of an id is one name below its folder, on every system."""

from pathlib import Path, PureWindowsPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_schemas.file_names import file_name_of
from dropanchor_schemas.keys import InvalidKeyError, id_from_chunk

identifiers = st.text(max_size=70) | st.text(st.sampled_from("./\\%:cCoOnN1 \0é"), max_size=8)


@given(identifiers)
def test_any_text_makes_one_name_below_its_folder_or_is_refused(identifier: str) -> None:
    try:
        name = file_name_of(identifier)
    except InvalidKeyError:
        return
    assert id_from_chunk(name) == identifier
    assert len(name.encode()) <= 200
    assert Path("/folder", name).resolve().parent == Path("/folder")
    windows = PureWindowsPath("C:/folder", name)
    assert (windows.parent, windows.name) == (PureWindowsPath("C:/folder"), name)
    assert not windows.is_reserved()


@pytest.mark.parametrize(
    "identifier", [".", "..", "", "a\nb", "a\0", "con", "Nul.yard", "COM1", "lpt9.x.y", "a.", "é" * 64]
)
def test_what_cannot_name_a_file_is_refused(identifier: str) -> None:
    with pytest.raises(InvalidKeyError):
        file_name_of(identifier)


@pytest.mark.parametrize(
    ("identifier", "name"),
    [
        ("cart-1", "cart-1"),
        ("a/b", "a%2Fb"),
        ("../x", "..%2Fx"),
        ("...x", "...x"),
        ("console", "console"),
        (" ", "%20"),
    ],
)
def test_all_else_has_the_name_that_it_has_in_keys(identifier: str, name: str) -> None:
    assert file_name_of(identifier) == name
