"""A history that is damaged is set aside and begun afresh, and says so; nothing of it is deleted."""

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dropanchor_schemas.site import Site
from dropanchor_service.estimation.columns import POSE
from dropanchor_service.history.tracks import FILE_NAME, MOST_DAMAGED, Tracks
from dropanchor_service.persistence import retention_of
from dropanchor_service.settings.model import HistorySettings
from dropanchor_service.store import SiteStore, TagTable

SECOND = 1_000_000_000
T_NS = 1_800_000_000 * SECOND


def opened(folder: Path) -> Tracks:
    tags = TagTable()
    tags.register("a")
    return Tracks(folder, retention_of(HistorySettings()), tags, SiteStore(Site(), {}, None), lambda: T_NS)


def written(tracks: Tracks, *times_s: int) -> bool:
    poses = np.zeros(len(times_s), POSE)
    poses["t_ns"], poses["x"], poses["anchor"] = [T_NS + t * SECOND for t in times_s], times_s, -1
    tracks.offer(poses)
    return tracks.writer.turn()


def times(tracks: Tracks) -> list[int]:
    return [(t_ns - T_NS) // SECOND for t_ns in tracks.poses("a", 0, 2**62, 1000).poses["t_ns"].tolist()]


def first_page(file: Path) -> None:
    file.write_bytes(b"?" * 4096 + file.read_bytes()[4096:])


def every_page_of_the_tables(file: Path) -> None:
    whole = file.read_bytes()
    file.write_bytes(whole[:4096] + b"?" * (len(whole) - 4096))


def its_end(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: -4096 * 3])


@pytest.mark.parametrize("damage", [first_page, every_page_of_the_tables, its_end])
def test_a_damaged_history_is_set_aside_and_a_new_one_goes_on(tmp_path: Path, damage: Callable[[Path], None]) -> None:
    before = opened(tmp_path)
    with before:
        assert written(before, *range(100))
    file = tmp_path / FILE_NAME
    damage(file)
    content = file.read_bytes()
    tracks = opened(tmp_path)
    assert written(tracks, 200, 201)
    assert times(tracks) == [200, 201]
    (name,) = tracks.damaged
    assert (tmp_path / name).read_bytes() == content
    assert tracks.writer.problem is None
    assert [name in problem for problem in tracks.problems] == [True]


def test_damage_that_comes_while_it_is_written_costs_no_new_pose(tmp_path: Path) -> None:
    tracks = opened(tmp_path)
    assert written(tracks, *range(100))
    assert tracks._file is not None
    tracks._file._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    every_page_of_the_tables(tmp_path / FILE_NAME)
    tracks._file._connection.execute("PRAGMA shrink_memory")
    assert written(tracks, 200)
    assert times(tracks) == [200]
    assert len(tracks.damaged) == 1


def test_a_disk_that_damages_every_file_is_not_filled_with_them(tmp_path: Path) -> None:
    for number in range(MOST_DAMAGED):
        (tmp_path / f"{FILE_NAME}.damaged-{number}").write_bytes(b"")
    (tmp_path / FILE_NAME).write_bytes(b"?" * 4096)
    tracks = opened(tmp_path)
    assert not written(tracks, 200)
    assert tracks.damaged == []
    assert "not a database" in str(tracks.problems)


def test_a_file_of_a_newer_version_is_left_where_it_is(tmp_path: Path) -> None:
    connection = sqlite3.connect(tmp_path / FILE_NAME)
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    tracks = opened(tmp_path)
    assert not written(tracks, 200)
    assert tracks.damaged == []


def test_a_disk_that_is_full_is_no_damage(tmp_path: Path) -> None:
    tracks = opened(tmp_path)
    assert written(tracks, *range(100))
    assert tracks._file is not None
    pages = tracks._file._connection.execute("PRAGMA page_count").fetchone()[0]
    tracks._file._connection.execute(f"PRAGMA max_page_count = {pages}")
    assert not written(tracks, *range(200, 5000))
    assert tracks.damaged == []
    shutil.rmtree(tmp_path)
