"""An only site becomes one of several, and the reverse, without anybody moving its files."""

import errno
import fcntl
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from dropanchor_schemas.site import Anchor
from dropanchor_service.events.drafts import destination_test
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence.site import open_sites
from dropanchor_service.persistence.site_files import OWNER_FILE, own_data_folder, put_site_files_in_place
from dropanchor_service.persistence.site_folders import SiteFolders
from dropanchor_service.persistence.zone_events import ZoneEvents
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings
from dropanchor_service.store import LatestPoses
from support.events import circle

Held = tuple[list[str], list[str], int]
"""The anchors, the zones and the number of events of a site."""


def settings_for(folder: Path, only: str | None = None, sites: Sequence[str] = ()) -> Settings:
    of_sites: dict[str, Any] = {"site": {"id": only}} if only else {"sites": {site: {} for site in sites}}
    return load_settings(options={"data_dir": str(folder), **of_sites}, environment={})


def start(settings: Settings, *, fill: bool = False) -> dict[str, Held]:
    """Open everything as the service does. Return what each site has.

    fill: give the first site one of each.
    """
    put_site_files_in_place(settings)
    sites, metrics = open_sites(settings), Metrics()
    with SiteFolders(settings, sites, lambda: 0, metrics) as folders:
        events = ZoneEvents(settings, sites, LatestPoses(), lambda: 0, metrics)
        with events:
            if fill:
                sites[0].store.set_anchor(Anchor(id="7"))
                events.parts[0].items.zones.put("dock", circle())
                events.stores[0].commit([destination_test("mes")], {})
                recorder, tracks = folders.all[0].recorder, folders.all[0].tracks
                assert recorder is not None
                assert tracks is not None
                recorder.folder.mkdir()
                assert tracks.writer.flush()
            return {
                site.id: (
                    [anchor.id for anchor in site.store.site.anchors],
                    list(parts.items.zones.all),
                    parts.store.newest,
                )
                for site, parts in zip(sites, events.parts, strict=True)
            }


FULL: Held = (["7"], ["dock"], 1)
EMPTY: Held = ([], [], 0)


def test_a_site_takes_its_files_along_when_it_becomes_one_of_several_and_back(tmp_path: Path) -> None:
    alone, together = settings_for(tmp_path, "yard"), settings_for(tmp_path, sites=["north", "yard"])
    start(alone, fill=True)
    before = {path.name for path in tmp_path.iterdir()}
    assert before >= {"site.json", "zones.json", "events.sqlite", "history.sqlite", "recordings"}
    assert start(together) == {"north": EMPTY, "yard": FULL}
    assert [path.name for path in tmp_path.iterdir()] == ["sites"]
    assert start(together) == {"north": EMPTY, "yard": FULL}
    assert start(alone) == {"yard": FULL}
    assert before <= {path.name for path in tmp_path.iterdir()}
    assert start(settings_for(tmp_path, "north")) == {"north": EMPTY}  # the yard makes room for it
    assert start(settings_for(tmp_path, sites=["yard"])) == {"yard": FULL}


def test_a_kill_while_files_move_is_made_up_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone, together = settings_for(tmp_path, "yard"), settings_for(tmp_path, sites=["north", "yard"])
    start(alone, fill=True)
    rename = Path.rename
    for settings in (together, alone):
        for moved in (1, 2):  # each attempt moves a few more
            left = moved

            def dying(path: Path, target: Path) -> Path:
                nonlocal left
                left -= 1
                if left < 0:
                    raise KeyboardInterrupt
                return rename(path, target)

            with monkeypatch.context() as patched:
                patched.setattr(Path, "rename", dying)
                with pytest.raises(KeyboardInterrupt):
                    put_site_files_in_place(settings)
        assert start(settings)["yard"] == FULL


def test_the_history_of_a_site_that_was_never_changed_moves_by_its_mark(tmp_path: Path) -> None:
    alone = settings_for(tmp_path, "yard")
    put_site_files_in_place(alone)
    assert (tmp_path / OWNER_FILE).read_text() == "yard\n"
    (tmp_path / "history.sqlite").write_bytes(b"")
    put_site_files_in_place(settings_for(tmp_path, "renamed"))
    put_site_files_in_place(settings_for(tmp_path, sites=["renamed", "b"]))
    assert (tmp_path / "sites" / "renamed" / "history.sqlite").exists()


def test_files_that_could_be_of_any_site_and_files_that_are_there_twice_stop_the_start(tmp_path: Path) -> None:
    (tmp_path / "history.sqlite").write_bytes(b"old")
    with pytest.raises(SettingsError, match=r"nothing says which of the sites it is: move them into .*/sites/a"):
        put_site_files_in_place(settings_for(tmp_path, sites=["a", "b"]))
    own = tmp_path / "sites" / "a"
    own.mkdir(parents=True)
    (own / "history.sqlite").write_bytes(b"new")
    for settings in (settings_for(tmp_path, sites=["a"]), settings_for(tmp_path, "a")):
        with pytest.raises(SettingsError, match=r"both .* hold history.sqlite of the site 'a': move one of them away"):
            put_site_files_in_place(settings)
    assert (tmp_path / "history.sqlite").read_bytes() + (own / "history.sqlite").read_bytes() == b"oldnew"


def test_a_folder_with_the_files_of_another_site_stops_the_start(tmp_path: Path) -> None:
    start(settings_for(tmp_path, sites=["a", "b"]), fill=True)
    (tmp_path / "sites" / "b").mkdir(exist_ok=True)
    (tmp_path / "sites" / "a" / "site.json").rename(tmp_path / "sites" / "b" / "site.json")
    with pytest.raises(SettingsError, match="the folder of the site 'b' holds the files of 'a'"):
        start(settings_for(tmp_path, sites=["a", "b"]))


def test_a_data_folder_that_cannot_be_locked_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def without(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", without)
    recovery = Recovery(tmp_path)
    with own_data_folder(settings_for(tmp_path), shared=False, note=recovery.note):
        assert recovery.problems() == [f"{tmp_path} cannot be locked: a second process would lose what both write"]
