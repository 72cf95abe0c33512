"""The history in PostgreSQL: sites share a database, days are dropped, and it survives what happens to databases."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psycopg
import pytest
from prometheus_client import generate_latest

from dropanchor_schemas.site import Site
from dropanchor_service.estimation.columns import Frame
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.postgresql.store import PostgresqlStorage
from dropanchor_service.history.storage import Retention
from dropanchor_service.history.summary_table import COARSE, DAY, FINE
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.metrics.persistence import HistoryMetrics
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.store import SiteStore, TagTable
from service.history.test_overview import HOUR, SECOND, T_NS, drive, figures, overview, summarise
from support.history_places import DatabasePlace, count_written, opened
from support.patience import PATIENCE_S
from support.postgresql import Postgresql, needs_postgresql

pytestmark = needs_postgresql
DAY_NS = 24 * HOUR * SECOND
EVERY_POSE = Retention(1, 0, 0, 2**62, 2**62)
NOW_NS = (time.time_ns() // DAY_NS - 3) * DAY_NS  # the server's clock has a say


@pytest.fixture
def url(postgresql: Postgresql) -> str:
    """The URL of a database of the test's own."""
    return postgresql.new_database()


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    with opened(url, NOW_NS) as database:
        yield database


def tracks_in(database: Database, retention: Retention = EVERY_POSE) -> Tracks:
    """Return the history of a site with the tag `a`. It has no thread: `write` writes it."""
    tags = TagTable()
    tags.register("a")
    storage = PostgresqlStorage(database, "yard", retention, lambda: NOW_NS)
    return Tracks(storage, retention, tags, SiteStore(Site(), {}, None))


def write(tracks: Tracks, *times_ns: int) -> bool:
    """Write poses at these times. Return False when they could not be written."""
    poses = drive(np.zeros(len(times_ns)))
    poses["t_ns"], poses["anchor"] = times_ns, -1
    tracks.offer(poses)
    return tracks.writer.flush()


def times(tracks: Tracks) -> list[int]:
    return [int(t_ns) for t_ns in tracks.reader.poses("a", 0, 2**62, 1000).poses["t_ns"]]


def count_rows(postgresql: Postgresql, url: str, table: str) -> int:
    ((number,),) = postgresql.run(url, f"SELECT count(*) FROM dropanchor_history.{table}")
    return int(number)


def test_sites_of_one_database_know_nothing_of_each_other(database: Database, url: str, postgresql: Postgresql) -> None:
    north, south = DatabasePlace(database, "north"), DatabasePlace(database, "Lager Süd")
    assert north.reader.span() is None
    for place, x in ((north, 1.0), (south, 2.0)):
        place.writer().insert(drive(np.array([0.0, 1.0]), x=x), ["cart", "cart"], ["17", None])
    assert [place.reader.poses("cart", T_NS, T_NS, 9).poses["x"].tolist() for place in (north, south)] == [[1], [2]]
    assert [sorted(place.reader.tags()) for place in (north, south)] == [["cart"], ["cart"]]
    assert north.reader.coverage(T_NS - 25 * SECOND, T_NS + 99 * SECOND, 100).stretches == [(T_NS, T_NS + 10 * SECOND)]
    assert north.reader.coverage(T_NS - 25 * SECOND, T_NS - SECOND, 100).stretches == []
    assert DatabasePlace(database, "nowhere").reader.tags() == []
    assert DatabasePlace(database, "nowhere").reader.coverage(0, T_NS, 100).stretches == []
    rows = postgresql.run(url, "SELECT site, tag, x, state FROM dropanchor_history.tracks ORDER BY x, t_ns")
    assert rows == [("north", "cart", 1.0, "tracking")] * 2 + [("Lager Süd", "cart", 2.0, "tracking")] * 2


TO_VERSION_1 = """
DROP VIEW dropanchor_history.tracks;
ALTER TABLE dropanchor_history.poses DROP COLUMN z, DROP COLUMN z_std_m, DROP COLUMN z_source;
UPDATE dropanchor_history.schema_version SET version = 1;
UPDATE dropanchor_history.stretches SET summaries = '\\x00' WHERE summaries != '\\x';
CREATE VIEW dropanchor_history.tracks AS SELECT sites.name AS site, tags.name AS tag,
    to_timestamp(p.t_ns / 1e9) AS time, p.t_ns, 'tracking' AS state, p.relative, p.x, p.y, p.heading_rad, p.speed_mps,
    p.sigma_pos_m FROM dropanchor_history.poses p JOIN dropanchor_history.tags ON tags.id = p.tag
    JOIN dropanchor_history.sites ON sites.id = p.site
"""


def test_the_view_never_shows_a_place_in_a_frame_of_the_tags_own_as_one_of_the_site(
    url: str, postgresql: Postgresql
) -> None:
    """Not even when the tables are of a version before."""
    poses = drive(np.array([0.0, 1.0]), x=2.0)
    poses["frame"] = [Frame.RELATIVE, Frame.SITE]
    with opened(url, NOW_NS) as database:
        DatabasePlace(database, "yard").writer().insert(poses, ["a", "a"], [None, None])
    columns = "state, x, y, heading_rad, sigma_pos_m, relative_x"
    query = f"SELECT {columns} FROM dropanchor_history.tracks ORDER BY t_ns"
    (state, *of_site, own), placed = postgresql.run(url, query)
    assert (state, of_site, own) == ("relative", [None] * 4, 2.0)
    assert (placed[0], placed[1], placed[5]) == ("tracking", 2.0, None)
    postgresql.run(url, TO_VERSION_1)
    with opened(url, NOW_NS) as database:
        DatabasePlace(database, "yard").writer().insert(drive(np.array([2.0])), ["a"], [None])
    assert postgresql.run(url, query)[:2] == [(state, *of_site, own), placed]


def test_tables_from_before_heights_are_read_and_continued(url: str, postgresql: Postgresql) -> None:
    seconds = np.arange(0.0, HOUR, 10.0)
    with opened(url, NOW_NS) as database:
        writer = DatabasePlace(database, "yard").writer()
        writer.insert(drive(seconds), ["a"] * len(seconds), [None] * len(seconds))
        summarise(writer)
    postgresql.run(url, TO_VERSION_1)
    with opened(url, NOW_NS) as database:
        place = DatabasePlace(database, "yard")
        with pytest.raises(HistoryError, match="schema version 1"):  # until somebody writes
            place.reader.span()
        writer = place.writer()
        writer.insert(drive(np.array([float(HOUR)]), z=4.0, z_std=0.25), ["a"], [None])
        summarise(writer)
        found = place.reader.poses("a", 0, 2**62, 999).poses
        assert (np.isnan(found["z"][:-1]).all(), found["z"][-1], len(found)) == (True, 4.0, 361)
        assert figures(overview(place, 0, 720 * HOUR), "a")["poses"] == 361
    heights = postgresql.run(url, "SELECT z, z_std_m FROM dropanchor_history.tracks ORDER BY t_ns")
    assert heights == [(None, None)] * 360 + [(4.0, 0.25)]


def test_a_stored_pose_tells_the_epoch_of_the_process_that_wrote_it(database: Database) -> None:
    place = DatabasePlace(database)
    for epoch, seconds in ((4, [0.0, 1.0]), (5, [2.0])):
        poses = drive(np.array(seconds))
        place.writer(epoch=epoch).insert(poses, ["a"] * len(poses), [None] * len(poses))
    assert place.reader.poses("a", 0, 2**62, 9).epochs.tolist() == [4, 4, 5]


def test_readers_take_the_later_owner_of_a_tag_from_its_first_pose_on(database: Database) -> None:
    """The earlier one was cut off, and writes what it had in its queue."""
    place, seconds = DatabasePlace(database), np.arange(0.0, 2 * HOUR, 5.0)
    earlier, later = place.writer(epoch=4), place.writer(epoch=5)
    earlier.insert(drive(seconds), ["a"] * len(seconds), [None] * len(seconds))
    summarise(earlier)
    late = seconds[seconds >= HOUR]
    later.insert(drive(late[:300], y=7.0), ["a"] * 300, [None] * 300)
    earlier.insert(drive(late + 1.0), ["a"] * len(late), [None] * len(late))
    for is_summarised in (False, True):
        found = place.reader.poses("a", 0, 2**62, 9999).poses
        assert found["y"].tolist() == [0.0] * 720 + [7.0] * 300
        assert (np.diff(found["t_ns"]) == 5 * SECOND).all()
        assert figures(overview(place, 0, 3 * HOUR), "a")["poses"] == 1020
        if not is_summarised:
            summarise(later)
            assert count_written(place, "summaries", COARSE, T_NS, T_NS + 2 * HOUR * SECOND) > 2


def test_whole_days_are_dropped_by_age_and_by_size(url: str, postgresql: Postgresql) -> None:
    days = [NOW_NS - back * DAY_NS for back in (9, 5, 4, 1)]
    with opened(url, NOW_NS) as database:
        tracks = tracks_in(database, Retention(1, 0, 0, 5 * DAY_NS, 2**62))
        assert write(tracks, *days)
        assert times(tracks) == days[1:]
    with opened(url, NOW_NS + DAY_NS) as database:
        tracks = tracks_in(database, Retention(1, 0, 0, 5 * DAY_NS, 2**62))
        assert write(tracks)
        assert times(tracks) == days[2:]
        assert tracks.usage.bytes > 100_000
    with opened(url, NOW_NS + 1000 * DAY_NS) as database:  # a clock that is far ahead drops nothing
        assert write(tracks_in(database, Retention(1, 0, 0, 9 * DAY_NS, 2**62)))
        assert times(tracks_in(database)) == days[2:]
    with opened(url, NOW_NS) as database:
        tracks = tracks_in(database, Retention(1, 0, 0, 5 * DAY_NS, 1))
        assert write(tracks)
        assert times(tracks) == days[3:]
        assert tracks.reader.span() == (days[3], days[3] + 10 * SECOND)
    tables = postgresql.run(url, "SELECT relname FROM pg_class WHERE relname ~ '_[0-9]{8}$' AND relkind = 'r'")
    assert len(tables) == 3


def test_a_site_that_keeps_less_than_another_deletes_its_own_poses_only(database: Database) -> None:
    other = DatabasePlace(database, "other", Retention(1, 0, 0, 30 * DAY_NS, 2**62))
    old = drive(np.zeros(1), t_ns=NOW_NS - 5 * DAY_NS)
    other.writer().insert(old, ["a"], [None])
    DatabasePlace(database, "yard").writer().insert(old, ["a"], [None])
    tracks = tracks_in(database, Retention(1, 0, 0, 3 * DAY_NS, 2**62))
    assert write(tracks, NOW_NS)
    assert times(tracks) == [NOW_NS]
    assert len(other.reader.poses("a", 0, 2**62, 9).poses) == 1


def test_a_database_that_is_away_costs_no_pose_and_is_named(
    postgresql: Postgresql, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracks = tracks_in(database)
    assert write(tracks, NOW_NS)
    postgresql.stop()
    try:
        assert not write(tracks, NOW_NS + SECOND)
        (problem,) = tracks.problems
        assert problem.startswith("history cannot be written: the database cannot be reached: connection to server ")
        assert "\n" not in problem
        with monkeypatch.context() as patched:
            patched.setattr("psycopg.connect", None)  # readers do not wait for what the writer could not reach
            with pytest.raises(HistoryError, match="cannot be reached"):
                times(tracks)
        restarted = tracks_in(database)  # a service that starts meanwhile
        assert not write(restarted, NOW_NS + 2 * SECOND)
    finally:
        postgresql.start()
    assert tracks.writer.flush()
    assert restarted.writer.flush()
    assert times(tracks) == [NOW_NS, NOW_NS + SECOND, NOW_NS + 2 * SECOND]
    assert (tracks.problems, tracks.written) == ([], 2)
    postgresql.stop()  # idle connections end, and the next ones must not fail for that
    postgresql.start()
    assert len(times(tracks)) == 3
    assert write(tracks, NOW_NS + 9 * SECOND)


def test_poses_that_find_no_place_while_the_database_is_away_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dropanchor_service.history.tracks.MAX_QUEUED_BYTES", 2 * drive(np.zeros(1)).nbytes)
    metrics = Metrics()
    with opened(f"postgresql://nobody@/history?host={tmp_path}", NOW_NS) as database:
        tracks = tracks_in(database)
        metrics.register(HistoryMetrics(tracks))
        for second in range(5):
            assert not write(tracks, NOW_NS + second * SECOND)
    text = generate_latest(metrics.registry).decode()
    assert "dropanchor_history_dropped_total 3.0" in text
    assert "dropanchor_history_failing 1.0" in text


def test_a_refused_login_is_named_without_the_password(postgresql: Postgresql, url: str, tmp_path: Path) -> None:
    name = url.rpartition("/")[2]
    access = postgresql.folder / "data" / "pg_hba.conf"
    access.write_text(f"host {name} guest 127.0.0.1/32 scram-sha-256\n{access.read_text()}")
    postgresql.run(url, "CREATE ROLE guest LOGIN PASSWORD 'tr0ub4dor'", "SELECT pg_reload_conf()")
    file = tmp_path / "password"
    database = Database(postgresql.url(name, "guest"), file, lambda: NOW_NS)
    tracks = tracks_in(database)

    def problem() -> str:
        assert not write(tracks, NOW_NS)
        (found,) = tracks.problems
        assert "tr0ub4dor" not in found
        assert "\n" not in found
        return found.removeprefix("history cannot be written: ")

    assert problem().startswith(f"the password file {file} cannot be read: ")
    file.write_text("tr0ub4dor with a typo\n")
    assert problem().startswith("the database refuses the login, check `url` and `password_file` in [history]: ")
    file.write_text("tr0ub4dor\n")
    assert problem().startswith("the user of the database lacks a right: permission denied for database")
    postgresql.run(url, "CREATE SCHEMA dropanchor_history AUTHORIZATION guest")
    assert tracks.writer.flush()
    assert tracks.problems == []
    database.close()


def test_a_full_disk_is_named_and_the_poses_are_written_once_there_is_room(
    postgresql: Postgresql, url: str, database: Database
) -> None:
    tracks = tracks_in(database)
    assert write(tracks, NOW_NS)
    fail = "RAISE EXCEPTION 'could not extend file: No space left on device' USING ERRCODE = 'disk_full'"
    postgresql.run(
        url,
        f"CREATE FUNCTION fill() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN {fail}; END $$",
        "CREATE TRIGGER full_disk BEFORE INSERT ON dropanchor_history.poses EXECUTE FUNCTION fill()",
    )
    assert not write(tracks, NOW_NS + SECOND)
    named = "the disk of the database is full: could not extend file: No space left on device"
    assert tracks.problems == [f"history cannot be written: {named}"]
    assert times(tracks) == [NOW_NS]
    postgresql.run(url, "DROP TRIGGER full_disk ON dropanchor_history.poses")
    assert tracks.writer.flush()
    assert times(tracks) == [NOW_NS, NOW_NS + SECOND]


def test_a_history_of_a_later_version_is_refused_and_not_changed(
    postgresql: Postgresql, url: str, database: Database
) -> None:
    tracks = tracks_in(database)
    assert write(tracks, NOW_NS)
    database.close()
    postgresql.run(url, "UPDATE dropanchor_history.schema_version SET version = 99")
    refusal = "it has schema 99, and this version knows 2): install that version, or name another database"
    assert not write(tracks, NOW_NS + SECOND)
    assert tracks.problems[0].endswith(refusal)
    with pytest.raises(HistoryError, match="schema 99"):
        tracks.reader.span()
    assert count_rows(postgresql, url, "poses") == 1


def test_two_services_may_write_the_same_site_and_no_summary_lacks_a_pose(url: str) -> None:
    """Both begin with an empty database, and summarise while the other one inserts."""
    failed: list[BaseException] = []
    steps = np.arange(0.0, 2 * HOUR, 10.0)

    def serve(offset_s: float) -> None:
        try:
            with opened(url) as database:
                writer = DatabasePlace(database, "yard").writer()
                for part in np.split(steps + offset_s, 20):
                    writer.insert(drive(part), ["a"] * len(part), [None] * len(part))
                    writer.summarise()
        except BaseException as error:
            failed.append(error)

    services = [threading.Thread(target=serve, args=(offset_s,)) for offset_s in (0.0, 5.0)]
    for service in services:
        service.start()
    for service in services:
        service.join(PATIENCE_S)
    assert failed == []
    with opened(url) as database:
        place = DatabasePlace(database, "yard")
        assert figures(overview(place, 0, 3 * HOUR), "a")["poses"] == 2 * len(steps)
        summarise(place.writer())
        assert count_written(place, "summaries", FINE, T_NS, T_NS + 2 * HOUR * SECOND) > 50
        assert figures(overview(place, 0, 720 * HOUR), "a")["poses"] == 2 * len(steps)


def test_a_day_that_somebody_reads_for_long_is_dropped_later(
    url: str, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dropanchor_service.history.postgresql.database.LOCK_TIMEOUT", "50ms")
    tracks = tracks_in(database)
    assert write(tracks, NOW_NS - 9 * DAY_NS, NOW_NS)
    short = tracks_in(database, Retention(1, 0, 0, 2 * DAY_NS, 2**62))
    database.close()
    with psycopg.connect(url) as reading:
        reading.execute("SELECT * FROM dropanchor_history.poses")
        monkeypatch.setattr("dropanchor_service.history.postgresql.database.MAINTAIN_S", 0.0)
        assert write(short, NOW_NS + SECOND)
        assert len(times(tracks)) == 3
    assert write(short)
    assert len(times(tracks)) == 2
    assert count_written(DatabasePlace(database, "yard"), "heat", DAY, 0, NOW_NS) == 0
