"""systemd receives the notifications."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from dropanchor_service.runtime.systemd import Systemd
from support.patience import PATIENCE_S


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(PATIENCE_S)
        yield listening


def test_each_notification_is_one_datagram(manager: socket.socket) -> None:
    systemd = Systemd({"NOTIFY_SOCKET": manager.getsockname()})
    systemd.ready()
    systemd.progress()
    systemd.stopping()
    assert [manager.recv(100) for _ in range(3)] == [b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]


def test_an_at_sign_marks_an_abstract_socket() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind("")  # the kernel chooses an abstract name
        name = listening.getsockname()
        listening.settimeout(PATIENCE_S)
        Systemd({"NOTIFY_SOCKET": "@" + name[1:].decode()}).ready()
        assert listening.recv(100) == b"READY=1"


def test_without_a_listening_manager_notifications_do_nothing(manager: socket.socket) -> None:
    Systemd({}).ready()
    Systemd({"NOTIFY_SOCKET": manager.getsockname() + "-gone"}).ready()
    full = Systemd({"NOTIFY_SOCKET": manager.getsockname()})
    for _ in range(2000):  # more than its queue takes
        full.progress()
