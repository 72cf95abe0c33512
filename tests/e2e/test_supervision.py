"""The service exits with an error when a thread dies, and reports its state to systemd."""

import signal
import socket
from pathlib import Path

import pytest

from dropanchor_service.commands import serve
from dropanchor_service.runtime.memory import HeapTrimmer
from dropanchor_service.runtime.systemd import Systemd
from support.patience import PATIENCE_S
from support.service import ended, running_service
from support.zenoh_router import free_endpoint

A_DYING_THREAD = """
import threading

run = threading.Thread.run

def run_or_die(thread):
    if thread.name == "{name}":
        raise RuntimeError("injected by the test")
    run(thread)

threading.Thread.run = run_or_die
"""


@pytest.mark.parametrize("thread", ["ingest", "checkpoints", "poses", "http"])
def test_a_thread_that_dies_is_named_and_the_process_exits_with_an_error(tmp_path: Path, thread: str) -> None:
    ports = ("--port", "0", "--zenoh-listen", free_endpoint())
    died = ended("serve", *ports, "--data-dir", str(tmp_path), before=A_DYING_THREAD.format(name=thread))
    assert died.returncode == 1
    assert f"the thread {thread} has died" in died.stderr
    assert "injected" in died.stderr


def test_systemd_is_notified_of_the_start_of_progress_and_of_the_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(300.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        with running_service(ready=False) as service:
            assert manager.recv(100) == b"READY=1"
            assert [manager.recv(100) for _ in range(3)] == 3 * [b"WATCHDOG=1"]
            service.process.send_signal(signal.SIGTERM)
            notification = manager.recv(100)
            while notification == b"WATCHDOG=1":
                notification = manager.recv(100)
            assert notification == b"STOPPING=1"
            assert service.process.wait(PATIENCE_S) == 0


def test_the_watchdog_is_not_fed_while_no_samples_are_fused(tmp_path: Path) -> None:
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
