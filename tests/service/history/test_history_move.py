"""A history that moves from a file into a database gives the same answers, also when it was stopped on the way."""

import sqlite3
from pathlib import Path
from subprocess import DEVNULL, Popen

import numpy as np
import pytest

from dropanchor_service.cli import main
from dropanchor_service.commands import history_move as moving
from dropanchor_service.commands.history_move import HistoryFile, Moved, move
from dropanchor_service.estimation.columns import Frame, HeightSource, State
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.postgresql.schema import SCHEMA
from dropanchor_service.history.storage import Retention
from service.history.test_overview import HOUR, SECOND, T_NS, drive, summarise
from support.history_places import KEEP_ALL, DatabasePlace, FilePlace, Place, opened
from support.postgresql import Postgresql, needs_postgresql
from support.service import command, environment
from support.zenoh_router import wait_until

pytestmark = needs_postgresql
END_NS = T_NS + 3 * HOUR * SECOND
SECONDS = np.arange(0.0, 2.0 * HOUR, 5.0)


def filled(path: Path) -> FilePlace:
    """Return the history of two tags, of which one was not tracked for a while, and which changed the anchor."""
    place = FilePlace(path)
    writer = place.writer()
    lost = drive(SECONDS, speed=1.0, state=State.COASTING, frame=Frame.RELATIVE)
    for tag, poses in (
        ("cart", drive(SECONDS, heading=0.5, sigma_pos=0.1, z=1.5, z_source=HeightSource.PRESSURE)),
        ("truck 7", lost),
    ):
        anchors = ["1" if t_ns < T_NS + 1000 * SECOND else None for t_ns in poses["t_ns"]]
        writer.insert(poses, [tag] * len(poses), anchors)
    summarise(writer)
    writer.close()
    return place


def answers(place: Place) -> list[object]:
    """Return what the page and REST ask for."""
    reader = place.reader
    tracks = [reader.poses(tag, 0, 2**62, 10_000) for tag in ("cart", "truck 7")]
    found, heat = reader.overview(None, T_NS, END_NS, 50), reader.heat_map(None, T_NS, END_NS, 1.0)
    named = sorted(repr((found.names[row["tag"]], *row.tolist()[1:])) for row in found.figures)
    return [
        sorted(reader.tags()),
        reader.span(),
        *((track.poses.tobytes(), track.anchors) for track in tracks),
        named,
        len(found.points),
        sorted(map(repr, vars(heat).items())),
    ]


def ignored(_: Moved) -> None:
    return


def test_the_command_moves_a_history_and_the_answers_are_the_same(
    tmp_path: Path, postgresql: Postgresql, capsys: pytest.CaptureFixture[str]
) -> None:
    place, url = filled(tmp_path / "history.sqlite"), postgresql.new_database()
    command = ["history", "move", f"--from={place.path}", f"--to={url}", "--site=yard"]
    assert main(command) == 0
    poses = 2 * len(SECONDS)
    assert capsys.readouterr().out == f"yard: {poses} poses copied, 0 were there already.\n"
    with opened(url) as database:
        assert answers(DatabasePlace(database, "yard")) == answers(place)
    assert main(command) == 0
    assert capsys.readouterr().out == f"yard: 0 poses copied, {poses} were there already.\n"
    for wrong, sentence in (
        (f"--to={url.replace('dropanchor@', 'dropanchor:secret@')}", "leave the password out"),
        (f"--from={tmp_path}/none.sqlite", "none.sqlite cannot be read"),
    ):
        assert main([*command, wrong]) == 2
        assert sentence in capsys.readouterr().err


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moving, "POSES", 100)


@pytest.mark.usefixtures("small_parts")
def test_a_move_that_was_stopped_goes_on_and_leaves_what_the_service_has_written(
    tmp_path: Path, shared_database: str
) -> None:
    place = filled(tmp_path / "history.sqlite")
    parts: list[int] = []

    def stop(moved: Moved) -> None:
        parts.append(moved.copied)
        if len(parts) == 5:
            raise KeyboardInterrupt

    with opened(shared_database) as database:
        there = DatabasePlace(database)
        newer = drive(np.array([3.0 * HOUR]))
        there.writer().insert(newer, ["cart"], ["1"])  # the service uses the database already
        with pytest.raises(KeyboardInterrupt):
            move(HistoryFile(place.path), database, there.site, KEEP_ALL, stop)
        moved = move(HistoryFile(place.path), database, there.site, KEEP_ALL, ignored)
        assert 0 < parts[-1] < 2 * len(SECONDS)
        assert (moved.present, moved.copied) == (parts[-1], 2 * len(SECONDS) - parts[-1])
        summarise(there.writer())
        writer = place.writer()
        writer.insert(newer, ["cart"], ["1"])
        summarise(writer)
        writer.close()
        assert answers(there) == answers(place)


def test_a_move_that_is_killed_while_it_writes_is_complete_after_the_next_one(
    tmp_path: Path, postgresql: Postgresql
) -> None:
    place, url = filled(tmp_path / "history.sqlite"), postgresql.new_database()
    words = ["history", "move", f"--from={place.path}", f"--to={url}", "--site=yard"]
    waits = f"SELECT 1 FROM pg_locks WHERE NOT granted AND relation = '{SCHEMA}.poses'::regclass"
    with opened(url) as database:
        there = DatabasePlace(database, "yard")
        there.writer().insert(drive(np.array([3.0 * HOUR])), ["cart"], ["1"])
        with postgresql.connect(url) as connection, connection.transaction():
            connection.execute(f"LOCK TABLE {SCHEMA}.poses IN EXCLUSIVE MODE")
            with Popen(command(*words), env=environment(), stderr=DEVNULL) as killed:
                wait_until(lambda: postgresql.run(url, waits))
                killed.kill()
        assert there.reader.tags() == ["cart"]
        assert main(words) == 0
        for tag, poses in (("cart", len(SECONDS) + 1), ("truck 7", len(SECONDS))):
            assert len(there.reader.poses(tag, 0, 2**62, 10_000).poses) == poses


def test_the_limits_of_a_site_stay_those_of_its_service(tmp_path: Path, shared_database: str) -> None:
    place = filled(tmp_path / "history.sqlite")
    with opened(shared_database) as database:
        there = DatabasePlace(database)
        there.writer().insert(drive(np.array([0.0])), ["cart"], [None])
        other = Retention(1, 0.0, 0, 5, 6)
        move(HistoryFile(place.path), database, there.site, other, ignored)
        assert limits(database, there.site) == (KEEP_ALL.keep_ns, KEEP_ALL.max_bytes)
        move(HistoryFile(place.path), database, f"{there.site} new", other, ignored)
        assert limits(database, f"{there.site} new") == (5, 6)


def limits(database: Database, site: str) -> object:
    with database.reading() as connection:
        assert connection is not None
        return connection.execute("SELECT keep_ns, max_bytes FROM sites WHERE name = %s", (site,)).fetchone()


def test_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    text, other = tmp_path / "a.txt", tmp_path / "b.sqlite"
    text.write_text("no history, but long enough to look like the head of a file" * 100)
    with pytest.raises(HistoryError, match=r"a\.txt is no history"):
        HistoryFile(text)
    with sqlite3.connect(other) as connection:
        connection.execute("PRAGMA user_version = 9")
    connection.close()
    with pytest.raises(HistoryError, match="it has schema 9, and this version knows 4"):
        HistoryFile(other)
