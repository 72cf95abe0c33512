"""A service whose thread dies ends with an error, and one that is supervised says what it does."""

import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dropanchor_service.commands import serve
from dropanchor_service.runtime.memory import HeapTrimmer
from dropanchor_service.runtime.systemd import Systemd
from support.service import environment
from support.zenoh_router import free_endpoint

DIES = """
import sys, threading
from dropanchor_service import cli
from dropanchor_service.{module} import {kind}

def dying(self, *_):
    raise RuntimeError("injected")

{kind}.{method} = dying
sys.exit(cli.main(sys.argv[1:]))
"""


@contextmanager
def service(*arguments: str, program: str | None = None, **more: str) -> Iterator["subprocess.Popen[str]"]:
    start = ["-m", "dropanchor_service"] if program is None else ["-c", program]
    ports = ["--port", "0", "--zenoh-listen", free_endpoint()]
    command = [sys.executable, *start, "serve", *ports, *arguments]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment(**more)) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("thread", "module", "kind", "method"),
    [
        ("ingest", "ingest_thread", "IngestThread", "_turn"),
        ("checkpoints", "checkpointer", "CheckpointThread", "_write"),
        ("poses", "zenoh_poses", "ZenohPoses", "_run"),
        ("http", "api.server", "Server", "main_loop"),
    ],
)
def test_a_thread_that_dies_is_named_and_ends_the_process_with_an_error(
    tmp_path: Path, thread: str, module: str, kind: str, method: str
) -> None:
    program = DIES.format(module=module, kind=kind, method=method)
    with service("--engine", "fleet", "--data-dir", str(tmp_path), program=program) as process:
        _, log = process.communicate(timeout=300.0)
    assert process.returncode == 1
    assert f"the thread {thread} has died" in log
    assert "injected" in log


def test_systemd_is_told_of_the_start_of_progress_and_of_the_end(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(300.0)
        with service(NOTIFY_SOCKET=str(tmp_path / "notify")) as process:
            assert manager.recv(100) == b"READY=1"
            assert [manager.recv(100) for _ in range(3)] == 3 * [b"WATCHDOG=1"]
            process.send_signal(signal.SIGTERM)
            heard = manager.recv(100)
            while heard == b"WATCHDOG=1":
                heard = manager.recv(100)
            assert heard == b"STOPPING=1"
            process.communicate(timeout=30.0)
        assert process.returncode == 0


def test_systemd_hears_of_no_progress_while_samples_are_not_fused(tmp_path: Path) -> None:
    class Stuck:
        makes_progress = False
        has_died = False

    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.setblocking(False)
        systemd = Systemd({"NOTIFY_SOCKET": str(tmp_path / "notify")})
        assert serve.supervise(Stuck(), systemd, HeapTrimmer())
        with pytest.raises(BlockingIOError):
            manager.recv(100)
