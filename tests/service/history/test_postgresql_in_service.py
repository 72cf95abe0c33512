"""A service whose history is in PostgreSQL: what REST answers, what its sites write, and which settings it refuses."""

import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from prometheus_client import generate_latest

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.estimation.columns import POSE, State
from dropanchor_service.history.errors import HistoryError
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.storage import Retention
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence.site import Persistence, open_database, open_sites
from dropanchor_service.persistence.site_folders import SiteFolders
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench
from support.history_places import opened
from support.pgbouncer import needs_pgbouncer, running_pgbouncer
from support.postgresql import Postgresql, needs_postgresql

SECOND = 1_000_000_000
HOUR_NS = 3600 * SECOND
EVERY_POSE = Retention(1, 0, 0, 30 * 24 * HOUR_NS, 2**40)


@pytest.fixture
def database(postgresql: Postgresql) -> Iterator[Database]:
    with opened(postgresql.new_database(), T_NS) as database:
        yield database


def driven(bench: ApiBench) -> ApiBench:
    """Write an hour of two tags, and the summaries."""
    for second in range(0, 3600, 5):
        bench.now_ns = T_NS - HOUR_NS + second * SECOND
        state = State.AMBIGUOUS if 1500 < second < 1530 else State.TRACKING
        bench.move("a", "b", x=[second / 100, -3.0], y=2.0, speed=[0.2, 0.0], state=state, range=12.5, anchor=[0, -1])
    bench.now_ns = T_NS
    for _ in range(3):
        bench.write_history()
    return bench


@needs_postgresql
@pytest.mark.parametrize(
    "path",
    [
        "history",
        "history/coverage?max_parts=50",
        "tracks?max_points=50",
        "tracks?tags=b",
        "heat-map?cell_m=1",
        "tags/a/track?limit=100",
        "tags/a/track?format=csv",
        "tags/b/track/file?format=gpx",
        f"tags/a/pose?at={T_NS - HOUR_NS // 2 + SECOND}",
        "tags/nobody/track",
    ],
)
def test_a_database_answers_what_a_file_answers(benches: tuple[ApiBench, ApiBench], path: str) -> None:
    in_file, in_database = (ask(bench.app(), "GET", f"/api/v1/{path}") for bench in benches)
    assert (in_database.status_code, in_database.text) == (in_file.status_code, in_file.text)
    assert (in_database.status_code, len(in_database.text) > 60) == (404 if "nobody" in path else 200, True)


@pytest.fixture(scope="module")
def benches(postgresql: Postgresql, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[ApiBench, ApiBench]]:
    """The same hour in a file and in a database."""
    site = Site(anchors=[Anchor(id="17")], georeference=Georeference(lat=48.1, lon=11.6))
    in_file = make_api_bench(site, tmp_path_factory.mktemp("file"), EVERY_POSE)
    with opened(postgresql.new_database(), T_NS) as database:
        yield driven(in_file), driven(make_api_bench(site, retention=EVERY_POSE, database=database))


@needs_postgresql
def test_a_database_that_is_away_makes_the_history_unreadable(tmp_path: Path) -> None:
    with opened(f"postgresql://nobody@/history?host={tmp_path}") as database:
        refused = ask(make_api_bench(retention=EVERY_POSE, database=database).app(), "GET", "/api/v1/tracks")
    assert kind_of(refused) == "history-unreadable"
    assert "The history cannot be read: the database cannot be reached: " in refused.json()["detail"]


def settings_of(url: str) -> Settings:
    return load_settings(options={"history": {"url": url}, "sites": {"north": {}, "Lager Süd": {}}}, environment={})


@needs_postgresql
def test_the_sites_of_a_service_share_a_database_without_a_data_folder(postgresql: Postgresql, tmp_path: Path) -> None:
    url, metrics = postgresql.new_database(), Metrics()
    settings = settings_of(url)
    sites = open_sites(settings)
    sites[1].store.epoch = 7  # this service has taken it over from another one
    poses = np.zeros(2, POSE)
    poses["row"], poses["x"] = [site.tags.register("cart").row for site in sites], [1.0, 2.0]
    poses["t_ns"], poses["state"], poses["anchor"] = T_NS, State.TRACKING, -1
    with SiteFolders(settings, sites, lambda: T_NS, metrics) as folders:
        folders.observers.poses(poses)
        tracks = [one.tracks for one in folders.all if one.tracks is not None]
        assert [one.writer.flush() for one in tracks] == [True, True]
        assert [one.reader.poses("cart", 0, 2 * T_NS, 9).poses["x"].tolist() for one in tracks] == [[1.0], [2.0]]
        assert len({id(one.usage) for one in tracks}) == 1
        assert f"dropanchor_history_bytes {float(tracks[0].usage.bytes)}" in generate_latest(metrics.registry).decode()
    of_sites = "dropanchor_history.poses JOIN dropanchor_history.sites ON id = site"
    epochs = postgresql.run(url, f"SELECT name, epoch FROM {of_sites} ORDER BY x")
    assert epochs == [("north", 0), ("Lager Süd", 7)]
    away = settings_of(f"postgresql://nobody@/history?host={tmp_path}")
    with SiteFolders(away, open_sites(away), lambda: T_NS, Metrics()) as folders:
        assert [one.tracks is not None and one.tracks.writer.flush() for one in folders.all] == [False, False]
        (problem,) = folders.problems()
    assert problem.startswith("sites north, Lager Süd: history cannot be written: the database cannot be reached: ")


@pytest.mark.parametrize(
    ("history", "message"),
    [
        ({"url": "mysql://db/history"}, "history.url: an address that begins with postgresql:// was expected"),
        ({"url": "postgresql://me:secret@db/x"}, "history.url: leave the password out: write it into a file, and"),
        ({"url": "postgresql://me@db/x?password=secret"}, "history.url: leave the password out"),
        ({"password_file": "p"}, "history: `password_file` is for a database: set `url` too"),
    ],
)
def test_settings_that_cannot_work_or_show_a_password_are_refused(history: dict[str, str], message: str) -> None:
    with pytest.raises(SettingsError) as refused:
        load_settings(options={"history": history}, environment={})
    assert message in str(refused.value)
    assert "secret" not in str(refused.value)


def test_a_parameter_that_postgresql_does_not_know_is_refused_at_the_start() -> None:
    settings = load_settings(options={"history": {"url": "postgresql://db/x?sslmod=require"}}, environment={})
    with pytest.raises(SettingsError, match=r'history\.url: .*"sslmod"'):
        open_database(settings, lambda: 0)


def test_without_the_extra_the_service_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    monkeypatch.delitem(sys.modules, "dropanchor_service.history.postgresql.database", raising=False)
    with pytest.raises(SettingsError, match=r"^history\.url needs the extra `postgresql`: pip install 'dropanchor-ser"):
        open_database(load_settings(options={"history": {"url": "postgresql://db/x"}}, environment={}), lambda: 0)


def test_a_history_that_is_off_needs_no_database() -> None:
    settings = load_settings(options={"history": {"url": "postgresql://db/x", "enabled": False}}, environment={})
    (site,) = open_sites(settings)
    assert open_database(settings, lambda: 0) is None
    assert Persistence(settings, site.tags, site.store, lambda: 0, None).tracks is None


@needs_postgresql
@needs_pgbouncer
@pytest.mark.parametrize(("pool_mode", "is_refused"), [("transaction", True), ("session", False)])
def test_a_pooler_that_lends_by_transaction_is_named(postgresql: Postgresql, pool_mode: str, is_refused: bool) -> None:
    name = postgresql.new_database().rpartition("/")[2]
    with (
        running_pgbouncer(postgresql, postgresql.folder, pool_mode) as port,
        opened(f"postgresql://dropanchor@127.0.0.1:{port}/{name}", T_NS) as database,
        pytest.raises(HistoryError, match="set pool_mode = session") if is_refused else nullcontext(),
        database.writing(),
    ):
        pass
