"""Whatever happens to a file of the data folder, the service starts, says what is damaged, and serves the rest.

Each file that a service writes gets each fault. `test_this_page_knows_every_file` finds those that are missing here.
"""

import re
import shutil
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import orjson
import pytest

from dropanchor_service.checkpoints import layouts
from dropanchor_service.checkpoints.format import Snapshot, encoded
from dropanchor_service.runtime.recovery import COPY, MARK, copy_of
from dropanchor_service.runtime.written_by import FILE as WRITTEN_BY
from dropanchor_service.security.api_keys import ApiKeys
from dropanchor_service.security.folder import SecurityError, SecurityFolder
from dropanchor_service.security.identity import Scope
from dropanchor_service.security.issued import Table
from dropanchor_service.settings.sources import SettingsError
from dropanchor_tag_client.host import VERSION
from service.data_folder import (
    CHECKPOINT,
    DATABASES,
    FILES,
    IN_SECURITY,
    NOT_READ,
    WITH_COPY,
    Parts,
    file_in,
    full_disk,
    is_let_in,
    opened,
    without_rights,
)


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return a folder in which a service has written every file, and the token of a share link."""
    folder = tmp_path_factory.mktemp("filled")
    SecurityFolder.make(folder / "security", Table(site="default", hosts=("localhost",), listen=("tls/[::]:7447",)), 9)
    ApiKeys(folder / "security").add("yard-manager", Scope.ADMIN)
    with opened(folder) as parts:
        return folder, parts.fill()


@pytest.fixture
def folder(filled: tuple[Path, str]) -> Iterator[Path]:
    """A copy of the folder in a place that a user without rights can reach."""
    with TemporaryDirectory() as made:
        target = Path(made) / "copy"
        shutil.copytree(filled[0], target)
        yield target


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    for place in range(8) if path.suffix == ".sqlite" else [len(whole) // 2]:
        whole[place] ^= 0x80
    path.write_bytes(whole)


def empty(path: Path) -> None:
    path.write_bytes(b"")


def make_it_of_another_type(path: Path) -> None:
    path.write_bytes(b"[1]\n")


def lock_up(path: Path) -> None:
    path.chmod(0)


CHANGES = [truncate, flip, empty, make_it_of_another_type]


def check(folder: Path, name: str, token: str, unusable: Sequence[str] = ()) -> None:
    """Check that a service starts, holds all that is good, and names what is not.

    unusable: what cannot be used, although it is good.
    """
    with opened(folder) as parts:
        held = parts.held(token)
        lost = {*unusable, *(() if name in WITH_COPY else (name,))}
        lost -= {"plans/image"} if unusable and held["plans/image"] else set()  # it is served as it is
        if name == "share_links.json":
            lost |= {"share_key"} if held["share_key"] is False else set()
        assert {each for each, is_there in held.items() if not is_there} == lost
        assert parts.tracks.writer.flush() or unusable
        problems = "; ".join([*parts.recovery.problems(), *parts.persistence.problems()])
        for each in (name, *unusable):
            assert in_words(each) in problems
        if name.startswith("share_"):
            assert not is_let_in(parts.links, token)


def in_words(name: str) -> str:
    return {"plans/image": ".png", "history.sqlite": "history"}.get(name, name)


@pytest.mark.parametrize(
    ("name", "change"),
    [(name, change) for name in FILES for change in CHANGES if (name, change) != ("share_key", flip)],  # see below
)
def test_a_damaged_file_is_set_aside_and_the_rest_is_served(
    folder: Path, filled: tuple[Path, str], name: str, change: Callable[[Path], None]
) -> None:
    path = file_in(folder, name)
    change(path)
    whole = path.read_bytes()
    check(folder, name, filled[1])
    (aside,) = path.parent.glob(f"{path.name}{MARK}*")
    assert aside.read_bytes() == whole
    with opened(folder) as parts:  # it is named until somebody has looked
        (problem,) = parts.recovery.problems()
        assert problem.endswith(f"look at {aside.relative_to(folder / 'data')}, then move it away")
        aside.unlink()
        assert parts.recovery.problems() == []


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_may_not_be_read_is_set_aside_and_the_rest_is_served(
    folder: Path, filled: tuple[Path, str], name: str
) -> None:
    lock_up(file_in(folder, name))
    with without_rights(folder):
        check(folder, name, filled[1])


@pytest.mark.parametrize("name", FILES)
def test_damage_on_a_disk_that_is_read_only_is_named_and_the_rest_is_served(
    folder: Path, filled: tuple[Path, str], name: str
) -> None:
    truncate(file_in(folder, name))
    with without_rights(folder):
        for path in (folder, *folder.rglob("*")):
            path.chmod(0o500 if path.is_dir() else 0o400)
        try:
            check(folder, name, filled[1], DATABASES)
        finally:
            for path in (folder, *folder.rglob("*")):
                path.chmod(0o700)


@pytest.mark.parametrize("name", FILES)
def test_damage_on_a_full_disk_is_named_and_the_rest_is_served(
    folder: Path, filled: tuple[Path, str], name: str
) -> None:
    path = file_in(folder, name)
    truncate(path)
    whole = path.read_bytes()
    with full_disk():
        check(folder, name, filled[1], DATABASES)
    if name in DATABASES:  # SQLite reads no file then: the next start finds out
        check(folder, name, filled[1])
    (aside,) = path.parent.glob(f"{path.name}{MARK}*")
    assert aside.read_bytes() == whole


@pytest.mark.parametrize("name", [*WITH_COPY, *DATABASES, "share_links.json", CHECKPOINT, *IN_SECURITY[:2]])
def test_a_file_of_a_later_version_stays_and_that_version_is_asked_for(folder: Path, name: str) -> None:
    path = file_in(folder, name)
    make_it_newer(path)
    for written in (folder / "data", folder / "security", folder / "security" / "keys"):
        (written / WRITTEN_BY).write_text("99.0.0\n")
    whole = path.read_bytes()
    asked = {CHECKPOINT: "which a later version wrote: install that"}.get(name, "this is .*: install version 99.0.0")
    assert re.search(f"{Path(name).name}.*{asked}", said_at_a_start(folder))
    unread = path.with_name(f"unread-{path.name}")
    assert (unread if name == CHECKPOINT else path).read_bytes() == whole
    assert not list(path.parent.glob(f"*{MARK}*"))
    assert (folder / "data" / WRITTEN_BY).read_text() == "99.0.0\n"


@pytest.mark.parametrize("name", [*WITH_COPY[:5], *IN_SECURITY[:2]])  # the others may have unknown fields
def test_what_this_version_does_not_know_is_of_a_later_one_even_if_nothing_names_that(folder: Path, name: str) -> None:
    path = file_in(folder, name)
    copy_of(path).unlink(missing_ok=True)
    document = orjson.loads(path.read_bytes())
    first_of(document)["of_later"] = True
    path.write_bytes(orjson.dumps(document))
    assert re.search(f"a later version wrote .*{name} .*of_later.*: install that version", said_at_a_start(folder))
    assert orjson.loads(path.read_bytes()) == document


def test_a_folder_names_the_latest_version_that_wrote_there_and_damage_is_mended_all_the_same(folder: Path) -> None:
    mark, zones = folder / "data" / WRITTEN_BY, folder / "data" / "zones.json"
    for written, left in (("0.0.9", VERSION), ("99.0.0", "99.0.0")):
        mark.write_text(written)
        truncate(zones)
        assert "zones.json is damaged; its last good copy is used" in said_at_a_start(folder)
        assert mark.read_text().strip() == left


def said_at_a_start(folder: Path) -> str:
    try:
        with opened(folder) as parts:
            parts.tracks.writer.flush()
            _, complaints = parts.checkpoints.newest()
            return "; ".join([*parts.recovery.problems(), *parts.persistence.problems(), *complaints])
    except SettingsError as error:
        return str(error)


def make_it_newer(path: Path) -> None:
    if path.suffix == ".sqlite":
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("PRAGMA user_version = 99")
    elif path.suffix == ".json":
        document = orjson.loads(path.read_bytes())
        item = first_of(document)
        item[next(iter(item))] = {"now": "an object"}
        path.write_bytes(orjson.dumps(document))
    else:
        later = f"{layouts.VERSION + 1}-{'0' * 16}"
        path.write_bytes(b"".join(encoded(Snapshot({}, {"value": 2}), later)))


def first_of(document: dict[str, Any]) -> dict[str, Any]:
    """Return the first item of a file, or what the file is about."""
    found: dict[str, Any] = next((item for item in document.values() if isinstance(item, dict)), document)
    return document if "hosts" in document else found


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", IN_SECURITY)
def test_a_damaged_folder_of_credentials_opens_no_door(folder: Path, name: str, change: Callable[[Path], None]) -> None:
    change(file_in(folder, name))
    if name == "ca.key":  # the service does without it
        with pytest.raises(SecurityError, match="is damaged"):
            SecurityFolder.open(folder / "security").add_tag("lift", 9)
        return
    with pytest.raises(SettingsError, match=rf"security.folder: .*{name} is damaged"):
        Parts(folder)


def test_another_key_ends_all_links(folder: Path, filled: tuple[Path, str]) -> None:
    flip(file_in(folder, "share_key"))  # any 32 bytes are a key
    with opened(folder) as parts:
        assert not is_let_in(parts.links, filled[1])


def test_this_page_knows_every_file(filled: tuple[Path, str]) -> None:
    data = filled[0] / "data"
    found = {str(path.relative_to(data)) for path in data.rglob("*") if path.is_file()}
    found = {"plans/image" if name.endswith(".png") else name for name in found}
    assert {name for name in found if not name.endswith(("-wal", "-shm", COPY))} == {*FILES, *NOT_READ}
    assert {name for name in found if name.endswith(COPY)} == {f"{name}{COPY}" for name in WITH_COPY}
