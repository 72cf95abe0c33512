"""One process holds a folder; others learn who it is; the kernel gives the folder back when that process ends."""

import errno
import fcntl
import logging
import os
import subprocess
from pathlib import Path

import pytest

from dropanchor_tag_client.folder_lock import FILE, FolderInUseError, FolderLock, LockIsLinkError
from support.commands import start_python

HOLD = """
import sys
from pathlib import Path
from dropanchor_tag_client.folder_lock import FolderLock
lock = FolderLock(Path(sys.argv[1]), shared=len(sys.argv) > 2)
print("held", flush=True)
sys.stdin.read()
"""


def holding(folder: Path, *shared: str) -> subprocess.Popen[str]:
    process = start_python("-c", HOLD, str(folder), *shared)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_process_learns_who_has_the_folder_and_gets_it_once_that_one_is_killed(tmp_path: Path) -> None:
    with holding(tmp_path) as other:
        with pytest.raises(FolderInUseError, match=rf"is in use by process {other.pid} on \S+ since 20\S+Z$"):
            FolderLock(tmp_path)
        owner = FolderLock.holder(tmp_path)
        assert owner is not None
        assert owner.pid == other.pid
        other.kill()
        other.wait()
        assert FolderLock.holder(tmp_path) is None
        with FolderLock(tmp_path):
            pass


def test_a_process_that_waits_gets_the_folder_when_it_is_free(tmp_path: Path) -> None:
    with holding(tmp_path) as other:
        assert other.stdin is not None
        other.stdin.close()
        FolderLock(tmp_path, wait_s=30.0).close()


def test_those_who_share_a_folder_keep_out_who_wants_it_alone(tmp_path: Path) -> None:
    with holding(tmp_path, "shared") as other, FolderLock(tmp_path, shared=True):
        with pytest.raises(FolderInUseError):
            FolderLock(tmp_path)
        other.kill()


def test_a_lock_that_says_nothing_counts(tmp_path: Path) -> None:
    with (tmp_path / FILE).open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(FolderInUseError, match="is in use by another process"):
            FolderLock(tmp_path)


def test_a_file_system_without_locks_is_said_once_and_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def without(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", without)
    with caplog.at_level(logging.WARNING), FolderLock(tmp_path) as lock:
        assert not lock.excludes_others
        (record,) = caplog.records
        assert "has no locks" in record.getMessage()
        assert "only one process" in record.getMessage()


def test_a_lock_that_is_a_link_is_refused_and_its_target_stays(tmp_path: Path) -> None:
    target = tmp_path / "shadow"
    target.write_text("root:x")
    (tmp_path / FILE).symlink_to(target)
    with pytest.raises(
        LockIsLinkError, match=r"owner\.lock is a link, and would overwrite what it leads to: remove it"
    ):
        FolderLock(tmp_path)
    assert FolderLock.holder(tmp_path) is None
    assert target.read_text() == "root:x"
