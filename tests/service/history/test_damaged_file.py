"""A damaged history is moved aside and reported, and a new one is started. Nothing is deleted."""

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dropanchor_schemas.site import Site
from dropanchor_service.estimation.columns import POSE
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.sqlite.store import FILE_NAME, SqliteStorage
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.persistence.site import retention_of
from dropanchor_service.runtime.recovery import MAX_ASIDE, Recovery
from dropanchor_service.settings.history import HistorySettings
from dropanchor_service.store import SiteStore, TagTable

SECOND = 1_000_000_000
T_NS = 1_800_000_000 * SECOND


def tracks_in(folder: Path) -> Tracks:
    tags = TagTable()
    tags.register("a")
    retention = retention_of(HistorySettings())
    return Tracks(SqliteStorage(folder, retention, lambda: T_NS), retention, tags, SiteStore(Site(), {}, None))


def write(tracks: Tracks, *times_s: int) -> bool:
    """Write poses at these times. Return False when they could not be written."""
    poses = np.zeros(len(times_s), POSE)
    poses["t_ns"], poses["x"], poses["anchor"] = [T_NS + t * SECOND for t in times_s], times_s, -1
    tracks.offer(poses)
    return tracks.writer.flush()


def times(tracks: Tracks) -> list[int]:
    return [(t_ns - T_NS) // SECOND for t_ns in tracks.reader.poses("a", 0, 2**62, 1000).poses["t_ns"].tolist()]


def damage_first_page(file: Path) -> None:
    file.write_bytes(b"?" * 4096 + file.read_bytes()[4096:])


def damage_table_pages(file: Path) -> None:
    whole = file.read_bytes()
    file.write_bytes(whole[:4096] + b"?" * (len(whole) - 4096))


def cut_end_off(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: -4096 * 3])


@pytest.mark.parametrize("damage", [damage_first_page, damage_table_pages, cut_end_off])
def test_a_damaged_history_is_moved_aside_and_a_new_one_is_written(
    tmp_path: Path, damage: Callable[[Path], None]
) -> None:
    before = tracks_in(tmp_path)
    with before:
        assert write(before, *range(100))
    file = tmp_path / FILE_NAME
    damage(file)
    content = file.read_bytes()
    tracks = tracks_in(tmp_path)
    assert write(tracks, 200, 201)
    assert times(tracks) == [200, 201]
    (name,) = tracks.damaged
    assert (tmp_path / name).read_bytes() == content
    assert tracks.writer.problem is None


def test_damage_while_the_file_is_open_costs_no_new_pose(tmp_path: Path, connections: list[sqlite3.Connection]) -> None:
    tracks = tracks_in(tmp_path)
    assert write(tracks, *range(100))
    (writing,) = connections
    writing.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    damage_table_pages(tmp_path / FILE_NAME)
    writing.execute("PRAGMA shrink_memory")  # so that it reads the damaged pages
    assert write(tracks, 200)
    assert times(tracks) == [200]
    assert len(tracks.damaged) == 1


def test_damage_that_a_reader_meets_is_set_aside_at_the_next_turn_without_a_new_pose(
    tmp_path: Path, connections: list[sqlite3.Connection]
) -> None:
    tracks = tracks_in(tmp_path)
    assert write(tracks, *range(100))
    connections[0].execute("PRAGMA wal_checkpoint(TRUNCATE)")
    damage_table_pages(tmp_path / FILE_NAME)
    with pytest.raises(HistoryError, match="malformed"):
        times(tracks)
    assert write(tracks)
    assert len(tracks.damaged) == 1
    assert times(tracks) == []


def test_damage_is_found_at_the_start_and_reported(tmp_path: Path) -> None:
    before = tracks_in(tmp_path)
    with before:
        assert write(before, *range(100))
    cut_end_off(tmp_path / FILE_NAME)
    recovery = Recovery(tmp_path)
    storage = SqliteStorage(tmp_path, retention_of(HistorySettings()), lambda: T_NS, recovery)
    (name,) = storage.damaged
    (problem,) = recovery.problems()
    assert problem.startswith("history.sqlite is damaged (")
    assert problem.endswith(f"; a new history was started: look at {name}, then move it away")


def test_a_disk_that_damages_every_file_does_not_fill_up_with_them(tmp_path: Path) -> None:
    for number in range(MAX_ASIDE):
        (tmp_path / f"{FILE_NAME}.damaged-{number}").write_bytes(b"")
    (tmp_path / FILE_NAME).write_bytes(b"?" * 4096)
    tracks = tracks_in(tmp_path)
    assert not write(tracks, 200)
    assert tracks.damaged == []
    assert "not a database" in str(tracks.problems)


def test_a_file_of_a_newer_version_stays_where_it_is(tmp_path: Path) -> None:
    connection = sqlite3.connect(tmp_path / FILE_NAME)
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    tracks = tracks_in(tmp_path)
    assert not write(tracks, 200)
    assert tracks.damaged == []


def test_a_full_disk_is_not_taken_for_damage(tmp_path: Path, connections: list[sqlite3.Connection]) -> None:
    tracks = tracks_in(tmp_path)
    assert write(tracks, *range(100))
    (writing,) = connections
    pages = writing.execute("PRAGMA page_count").fetchone()[0]
    writing.execute(f"PRAGMA max_page_count = {pages}")
    assert not write(tracks, *range(200, 5000))
    assert tracks.damaged == []
    shutil.rmtree(tmp_path)
