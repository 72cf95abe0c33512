"""The number of receive threads of a router after a client has connected."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen

import pytest

from dropanchor_service.zenoh_io.receive_threads import COUNT, VARIABLE
from support.service import command, environment, running_service
from support.zenoh_router import connected_session, free_endpoint, wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="counts threads in /proc")


def receive_threads(pid: int) -> int:
    names = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/comm")]
    return sum(name.startswith("rx-") for name in names)


@contextmanager
def router(endpoint: str, **more: str) -> Iterator[int]:
    """Run a router; yield its process id."""
    clean = {name: value for name, value in environment().items() if name != VARIABLE}
    words = command("router", "--zenoh-listen", endpoint)
    with Popen(words, stderr=PIPE, text=True, env=clean | more) as process:
        try:
            assert process.stderr is not None
            assert any("ready at" in line for line in process.stderr)
            yield process.pid
        finally:
            process.kill()


def test_a_router_has_enough_receive_threads() -> None:
    endpoint = free_endpoint()
    with router(endpoint) as pid, connected_session(endpoint):
        wait_until(lambda: receive_threads(pid) == COUNT)


def test_the_environment_variable_overrides_the_number() -> None:
    endpoint = free_endpoint()
    with router(endpoint, **{VARIABLE: "(rx: (worker_threads: 3))"}) as pid, connected_session(endpoint):
        wait_until(lambda: receive_threads(pid) == 3)


@pytest.mark.parametrize("subcommand", ["serve", "demo"])
def test_a_service_with_the_router_inside_has_enough_receive_threads(
    subcommand: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with running_service("--log-level", "INFO", subcommand=subcommand) as service, connected_session(service.zenoh):
        try:
            wait_until(lambda: receive_threads(service.process.pid) == COUNT)
        finally:
            service.stop()  # the demo also stops its simulated tags
