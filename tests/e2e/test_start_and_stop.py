"""The program says in one sentence why it cannot start, and stops soon after a signal with exit code 0."""

import signal
import socket
import subprocess
from pathlib import Path

import httpx
import pytest

from support.patience import PATIENCE_S
from support.service import command, ended, environment, running_service
from support.zenoh_router import (
    free_endpoint,
    running_router,
    wait_until,
)


def test_a_taken_http_port_is_reported_in_one_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = ended("serve", "--port", str(port), "--zenoh-listen", free_endpoint())
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert f"port {port}: another program uses it" in result.stderr


@pytest.mark.parametrize("subcommand", ["serve", "router"])
def test_a_taken_zenoh_port_is_reported_in_one_sentence(subcommand: str) -> None:
    endpoint = free_endpoint()
    with running_router(endpoint):
        result = ended(subcommand, *(("--port", "0") if subcommand == "serve" else ()), "--zenoh-listen", endpoint)
    assert result.returncode == 2
    assert [line for line in result.stderr.splitlines() if line.startswith("dropanchor")] == [
        f"dropanchor {subcommand}: Zenoh cannot listen on {endpoint}: the port is in use. "
        "Choose another one with --zenoh-listen."
    ]


def test_bad_settings_are_reported_with_file_and_key(tmp_path: Path) -> None:
    file = tmp_path / "yard.toml"
    file.write_text("[http]\nprot = 80\n")
    result = ended("serve", "--config", str(file), DROPANCHOR_MAX_TAGS="none")
    assert result.returncode == 2
    assert f"{file}: http.prot is not a setting; did you mean port?" in result.stderr
    assert "the environment: max_tags" in result.stderr


def test_a_signal_ends_a_service_at_once_even_with_a_stream_open_and_a_change_over_rest_survives(
    tmp_path: Path,
) -> None:
    for how in (signal.SIGINT, signal.SIGTERM):
        with (
            running_service("--data-dir", str(tmp_path)) as service,
            httpx.stream("GET", f"{service.url}/api/v1/stream") as stream,
        ):
            assert stream.status_code == 200
            anchors = service.get("/api/v1/anchors")["anchors"]
            service.put("/api/v1/anchors/gate", {"id": "gate", "x": 1.5, "y": 2.0, "z": 0.0})
            assert service.stop(how) == 0
        assert "Traceback" not in "".join(service.log)
    assert [(anchor["id"], anchor["x"]) for anchor in anchors] == [("gate", 1.5)]


def test_a_service_is_ready_while_the_router_of_the_command_runs_and_both_stop_on_a_signal() -> None:
    endpoint = free_endpoint()

    def is_ready() -> bool:
        return service.ask("GET", "/api/v1/health/ready").status_code == 200

    with running_service("--zenoh-connect", endpoint, ready=False) as service:
        problem = service.ask("GET", "/api/v1/health/ready")
        assert problem.status_code == 503
        assert "no connection to the Zenoh router" in problem.text
        words = command("router", "--zenoh-listen", endpoint)
        with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment()) as router:
            try:
                assert router.stderr is not None
                assert f"ready at {endpoint}" in router.stderr.readline()
                wait_until(is_ready)
                router.send_signal(signal.SIGTERM)
                assert router.wait(PATIENCE_S) == 0
                wait_until(lambda: not is_ready())
            finally:
                router.kill()
        assert service.stop() == 0


def test_the_help_contains_examples() -> None:
    for arguments in ((), ("serve",)):
        result = ended(*arguments, "--help")
        assert result.returncode == 0
        assert "examples:" in result.stdout
