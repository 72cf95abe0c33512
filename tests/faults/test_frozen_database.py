"""A database that accepts what it is sent and says nothing: requests end, readiness names it, and the service stops."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import httpx

from support.patience import PATIENCE_S
from support.postgresql import Postgresql, needs_postgresql, running_postgresql
from support.service import Running, running_service
from support.zenoh_router import wait_until

TRACK = "/api/v1/tags/a/track?limit=10"
CONNECTIONS = "SELECT count(*) FROM pg_stat_activity WHERE application_name = 'dropanchor'"


def answer(service: Running, path: str = TRACK) -> httpx.Response:
    return httpx.get(service.url + path, timeout=PATIENCE_S)


@contextmanager
def with_database(folder: Path) -> Iterator[tuple[Running, Postgresql]]:
    """Run a service with a database from which it has read."""
    with running_postgresql() as server:
        config = folder / "d.toml"
        config.write_text(f'[history]\nurl = "{server.new_database()}"\n[tags.a]\n')
        with running_service("--config", str(config)) as service:
            wait_until(lambda: answer(service).status_code == 200 and server.run(server.url(), CONNECTIONS)[0][0] > 1)
            yield service, server


@needs_postgresql
def test_a_frozen_database_is_named_and_nobody_waits_for_it_for_long(tmp_path: Path) -> None:
    with with_database(tmp_path) as (service, server):
        with server.frozen():
            waited = answer(service)
            assert waited.status_code == 503
            assert "the database cannot be reached: it has said nothing for 14 s" in waited.text
            wait_until(lambda: "the database has not answered for more than 10 s" in ready(service))
            assert answer(service, "/api/v1/poses").status_code == 200
        wait_until(lambda: answer(service).status_code == 200 and "the database" not in ready(service))


def ready(service: Running) -> str:
    return answer(service, "/api/v1/health/ready").text


@needs_postgresql
def test_a_service_stops_while_a_request_waits_for_a_frozen_database(tmp_path: Path) -> None:
    with with_database(tmp_path) as (service, server), server.frozen():
        found: list[int] = []

        def wait() -> None:
            try:
                found.append(answer(service).status_code)
            except httpx.HTTPError:
                found.append(0)

        waiting = Thread(target=wait, daemon=True)
        waiting.start()
        waiting.join(1.0)
        assert not found, "the request did not wait"
        assert service.stop() == 0
        waiting.join()
        assert found in ([503], [0])
        assert "Traceback" not in "".join(service.log)
