"""A page whose store the test fills."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from dropanchor_service.api.app import DASHBOARD
from service.dashboard.past_place import past_place
from service.dashboard.place import Place, live_api_bench
from support.axe import axe_source
from support.http_server import running_server


@pytest.fixture
def place() -> Iterator[Place]:
    bench = live_api_bench()
    with running_server(bench.app(DASHBOARD, endpoints=("tcp/127.0.0.1:19747",)), bench.stopping) as port:
        yield Place(bench, f"http://127.0.0.1:{port}/")


@pytest.fixture
def past(tmp_path: Path) -> Iterator[tuple[Place, int]]:
    """A page whose service stores the past until one hour ago, and the end of that past in ns."""
    with past_place(tmp_path) as found:
        yield found


@pytest.fixture(scope="session")
def axe(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> str:
    base = tmp_path_factory.getbasetemp()
    return axe_source((base if worker_id == "master" else base.parent) / "axe")  # the workers share the parent
