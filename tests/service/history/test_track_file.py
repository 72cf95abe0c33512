"""The history's file stores poses, prunes them and survives failed writes and kills."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dropanchor_service.estimation.columns import POSE, Array, Frame, HeightSource, State
from dropanchor_service.history.reader import TrackReader
from dropanchor_service.history.sqlite.track_file import FileReader, TrackFileError, TrackWriter
from support.history_places import Place

SECOND = 1_000_000_000
T_NS = 1_800_000_000 * SECOND
LONG = 2**40


def poses(*offsets_s: float, x: float = 0.0) -> Array:
    made = np.zeros(len(offsets_s), POSE)
    made["t_ns"] = [T_NS + round(offset * SECOND) for offset in offsets_s]
    made["x"], made["speed"] = x, np.nan
    made["cov"] = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, 0.25], [0.5, 0.25, 0.125]])
    return made


def times(reader: TrackReader, tag: str, from_s: float = -LONG, to_s: float = LONG, **options: object) -> list[float]:
    window = max(0, T_NS + round(from_s * SECOND)), min(2**62, T_NS + round(to_s * SECOND))
    found = reader.poses(tag, *window, **{"limit": 1000, **options})  # type: ignore[arg-type]
    return [(t_ns - T_NS) / SECOND for t_ns in found.poses["t_ns"].tolist()]


def test_poses_are_read_in_order_of_time_with_their_anchors(any_place: Place) -> None:
    writer, reader = any_place.writer(), any_place.reader
    writer.insert(poses(25, 0, 3, 1), ["a", "a", "b", "a"], ["7", None, "7", "Süd"])
    assert times(reader, "a") == [0, 1, 25]
    assert times(reader, "b") == [3]
    assert times(reader, "c") == []
    assert (reader.has_tag("b"), reader.has_tag("c")) == (True, False)
    found = reader.poses("a", T_NS, T_NS + 60 * SECOND, 10)
    assert found.anchors == [None, "Süd", "7"]
    np.testing.assert_array_equal(found.poses["cov"][1], poses(0)["cov"][0])
    assert np.isnan(found.poses["speed"]).all()
    writer.close()


def test_a_pose_keeps_its_state_and_its_frame(any_place: Place) -> None:
    writer, reader = any_place.writer(), any_place.reader
    made = poses(0, 1)
    made["state"], made["frame"] = [State.TRACKING, State.DEGRADED], [Frame.RELATIVE, Frame.SITE]
    writer.insert(made, ["a", "a"], [None, None])
    found = reader.poses("a", T_NS, T_NS + 60 * SECOND, 10).poses
    assert found["state"].tolist() == [State.TRACKING, State.DEGRADED]
    assert found["frame"].tolist() == [Frame.RELATIVE, Frame.SITE]
    writer.close()


def test_a_pose_keeps_its_height_and_where_that_comes_from(any_place: Place) -> None:
    writer, reader = any_place.writer(), any_place.reader
    made = poses(0, 1)
    made["z"], made["z_std"], made["z_source"] = [3.5, np.nan], [0.25, np.nan], HeightSource.PRESSURE
    writer.insert(made, ["a", "a"], [None, None])
    found = reader.poses("a", T_NS, T_NS + 60 * SECOND, 10).poses
    np.testing.assert_array_equal(found["z"], [3.5, np.nan])
    np.testing.assert_array_equal(found["z_std"], [0.25, np.nan])
    assert found["z_source"].tolist() == [HeightSource.PRESSURE] * 2
    writer.close()


def without_heights(path: Path) -> None:
    """Make the file one of version 3, whose records end before their height."""
    with closing(sqlite3.connect(path)) as old:
        old.execute("UPDATE poses SET pose = substr(pose, 1, 66)")
        old.execute(
            "UPDATE summaries SET tags = X'00' WHERE tags != X''"
        )  # summaries of version 3 are of another length
        old.execute("PRAGMA user_version = 3")
        old.commit()


def test_a_file_from_before_heights_is_read_and_continued(tmp_path: Path) -> None:
    path = tmp_path / "h.sqlite"
    writer, reader = TrackWriter(path), FileReader(path)
    writer.insert(poses(*range(300), x=7.0), ["a"] * 300, [None] * 300)
    while writer.summarise():
        pass
    writer.close()
    without_heights(path)
    old = reader.poses("a", T_NS, T_NS + 600 * SECOND, 1000).poses
    assert (old["x"].tolist(), np.isnan(old["z"]).all()) == ([7.0] * 300, True)
    writer, new = TrackWriter(path), poses(300, x=8.0)
    new["z"], new["z_std"] = 2.0, 0.5
    writer.insert(new, ["a"], [None])
    for _ in range(3):
        while writer.summarise():
            pass
    found = reader.poses("a", T_NS, T_NS + 600 * SECOND, 1000).poses
    assert (len(found), np.isnan(found["z"][:300]).all(), found["z"][300]) == (301, True, 2.0)
    overview = reader.overview(None, T_NS, T_NS + 600 * SECOND, 1000)
    assert (overview.figures["poses"].tolist(), overview.points["point"]["z"][-1]) == ([301], 2.0)
    assert np.isnan(overview.points["point"]["z"][0])
    writer.close()


def test_a_window_includes_its_ends_and_can_be_read_from_either(any_place: Place) -> None:
    writer, reader = any_place.writer(), any_place.reader
    writer.insert(poses(*range(100)), ["a"] * 100, [None] * 100)
    assert times(reader, "a", 9, 12) == [9, 10, 11, 12]
    assert times(reader, "a", 9, 40, limit=3) == [9, 10, 11]
    assert times(reader, "a", 9, 40, limit=2, newest_first=True) == [40, 39]
    writer.close()


def test_inserts_of_any_size_use_few_different_statements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    statements: set[str] = set()

    class RecordingConnection(sqlite3.Connection):
        def execute(self, sql: str, *values: Any) -> sqlite3.Cursor:
            statements.add(sql)
            return super().execute(sql, *values)

    connect = sqlite3.connect
    monkeypatch.setattr(
        sqlite3, "connect", lambda *args, **kwargs: connect(*args, **kwargs, factory=RecordingConnection)
    )
    writer, reader = TrackWriter(tmp_path / "h.sqlite"), FileReader(tmp_path / "h.sqlite")
    counts = [*range(1, 150), 1023, 1024, 1025]
    for number, count in enumerate(counts):
        writer.insert(poses(*range(count)), [str(number)] * count, [None] * count)
    writer.close()
    assert len([sql for sql in statements if "INTO poses" in sql]) <= 10
    assert [len(times(reader, str(number), limit=2000)) for number in range(len(counts))] == counts


def test_a_pose_of_the_same_time_is_replaced(any_place: Place) -> None:
    writer, reader = any_place.writer(), any_place.reader
    for x in (1.0, 2.0):
        writer.insert(poses(0, x=x), ["a"], [None])
    assert reader.poses("a", T_NS, T_NS, 10).poses["x"].tolist() == [2.0]
    writer.close()


def test_the_oldest_poses_are_pruned_first_by_age_and_by_size(tmp_path: Path) -> None:
    writer, reader = TrackWriter(tmp_path / "h.sqlite"), FileReader(tmp_path / "h.sqlite")
    writer.insert(poses(*range(5000)), ["a"] * 5000, [None] * 5000)
    while writer.prune(T_NS + 1005 * SECOND, 2**40):
        pass
    assert times(reader, "a")[0] == 1000
    before = writer.used_bytes()
    while writer.prune(0, before // 2):
        pass
    assert writer.used_bytes() <= before // 2
    assert times(reader, "a", newest_first=True)[0] == 4999
    writer.close()


@contextmanager
def on_full_disk(writing: sqlite3.Connection, writer: TrackWriter) -> Iterator[None]:
    """Let the file grow by three pages at most while the block runs, which has to fail."""
    writing.execute(f"PRAGMA max_page_count = {writer.used_bytes() // 4096 + 3}")
    with pytest.raises(sqlite3.OperationalError, match="full"):
        yield
    writing.execute("PRAGMA max_page_count = 1000000")


def test_a_failed_insert_leaves_nothing_behind(tmp_path: Path, connections: list[sqlite3.Connection]) -> None:
    writer, reader = TrackWriter(tmp_path / "h.sqlite"), FileReader(tmp_path / "h.sqlite")
    (writing,) = connections
    writer.insert(poses(0), ["a"], [None])
    many = poses(*range(1, 5001))
    with on_full_disk(writing, writer):
        writer.insert(many, ["new"] * 5000, ["7"] * 5000)
    assert not reader.has_tag("new")
    writer.insert(many, ["new"] * 5000, ["7"] * 5000)
    assert len(times(reader, "new", limit=9999)) == 5000
    writer.close()


def test_a_summary_ends_with_new_poses_also_after_an_insert_that_failed(
    tmp_path: Path, connections: list[sqlite3.Connection]
) -> None:
    writer = TrackWriter(tmp_path / "h.sqlite")
    (writing,) = connections
    writer.insert(poses(*range(0, 300, 5)), ["a"] * 60, [None] * 60)
    assert not writer.summarise()  # from now on, what is over rests
    while writer.summarise():
        pass
    count = "SELECT count(*) FROM summaries WHERE level = 0"
    assert writing.execute(count).fetchone() == (2,)
    with on_full_disk(writing, writer):
        writer.insert(poses(*np.arange(1, 100, 0.01)), ["a"] * 9900, [None] * 9900)
    assert writing.execute(count).fetchone() == (2,)
    writer.insert(poses(1), ["a"], [None])
    assert writing.execute(count).fetchone() == (1,)
    writer.close()


def test_a_write_begins_no_transaction_and_deletes_no_summary_for_nothing(
    tmp_path: Path, connections: list[sqlite3.Connection]
) -> None:
    writer = TrackWriter(tmp_path / "h.sqlite")
    (writing,) = connections
    writer.insert(poses(0), ["a"], [None])
    while writer.summarise():
        pass
    statements: list[str] = []
    writing.set_trace_callback(statements.append)
    writer.insert(poses(1), ["a"], [None])
    assert not writer.summarise()
    assert [statement.split()[0] for statement in statements] == ["BEGIN", "INSERT", "INSERT", "COMMIT"]
    writer.close()


def test_a_file_that_has_no_tables_yet_has_no_poses(tmp_path: Path) -> None:
    (tmp_path / "h.sqlite").touch()  # as at the moment before a writer fills it
    assert times(FileReader(tmp_path / "h.sqlite"), "a") == []


@pytest.mark.parametrize("content", [b"this is not a database, " * 100, None])
def test_a_file_of_another_kind_or_version_is_not_changed(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "h.sqlite"
    if content is None:
        connection = sqlite3.connect(path)
        connection.execute("PRAGMA user_version = 99")
        connection.close()
    else:
        path.write_bytes(content)
    before = path.read_bytes()
    with pytest.raises(sqlite3.DatabaseError if content else TrackFileError):
        TrackWriter(path)
    assert path.read_bytes() == before


def test_a_writer_that_is_killed_in_a_transaction_loses_only_that_transaction(
    tmp_path: Path, connections: list[sqlite3.Connection]
) -> None:
    path = tmp_path / "h.sqlite"
    writer = TrackWriter(path)
    (writing,) = connections
    writer.insert(poses(*range(100)), ["a"] * 100, [None] * 100)
    writing.execute("BEGIN")
    writing.execute("DELETE FROM poses")
    torn = tmp_path / "copy"
    torn.mkdir()
    for file in tmp_path.glob("h.sqlite*"):  # as a kill leaves them
        (torn / file.name).write_bytes(file.read_bytes())
    assert len(times(FileReader(torn / "h.sqlite"), "a")) == 100
    writing.execute("ROLLBACK")
    writer.close()


def test_a_slow_reader_does_not_block_the_writer(tmp_path: Path) -> None:
    path = tmp_path / "h.sqlite"
    writer = TrackWriter(path)
    writer.insert(poses(*range(100)), ["a"] * 100, [None] * 100)
    slow = sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)
    rows = slow.execute("SELECT t_ns FROM poses")
    assert rows.fetchone() is not None
    writer.insert(poses(*range(100, 200)), ["a"] * 100, [None] * 100)
    assert writer.prune(T_NS + 50 * SECOND, LONG) == 1
    assert len(rows.fetchall()) == 99  # the rows at the time it began
    slow.close()
    assert len(times(FileReader(path), "a")) == 190
    writer.close()
