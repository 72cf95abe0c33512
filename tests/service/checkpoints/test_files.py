"""A damaged checkpoint is never used, whatever happens while it is written or to the file afterwards."""

import errno
import os
import threading
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dropanchor_service.checkpoints.files import CheckpointFolder
from dropanchor_service.checkpoints.format import Snapshot, UnreadableLayoutError, decoded
from dropanchor_service.estimation.columns import HYPOTHESIS
from dropanchor_service.estimation.fleet.frontend.attitude import ATTITUDE

WRITING = 8  # file operations until the new name exists: open, writes of head, three arrays and digest, fsync, replace


def snapshot(value: int) -> Snapshot:
    poses, fronts = np.zeros(1, HYPOTHESIS), np.zeros(1, ATTITUDE)
    poses["row"], poses["x"] = value, np.nan
    arrays = {
        "poses": poses,
        "nothing": np.zeros(0, HYPOTHESIS),
        "fronts": fronts,
        "window": np.full((2, 4), value, "u8"),
    }
    return Snapshot(arrays, {"tags": ["a", "Süd"], "value": value})


def folder_of(path: Path, layout: str = "layout") -> CheckpointFolder:
    def decode(whole: bytes) -> Snapshot:
        found, content = decoded(whole)
        if found != layout:
            raise UnreadableLayoutError(f"its layout is {found}")
        return content

    return CheckpointFolder(path, layout, decode)


def value_in(folder: CheckpointFolder) -> int | None:
    found, _ = folder.newest()
    return None if found is None else int(found.document["value"])


def test_a_checkpoint_is_read_as_it_was_written_to_the_last_bit(tmp_path: Path) -> None:
    written = snapshot(7)
    folder_of(tmp_path).write(written)
    found, complaints = folder_of(tmp_path).newest()
    assert complaints == []
    assert found is not None
    assert found.document == written.document
    assert found.arrays.keys() == written.arrays.keys()
    for name, array in written.arrays.items():
        assert found.arrays[name].dtype == array.dtype
        assert found.arrays[name].shape == array.shape
        assert found.arrays[name].tobytes() == array.tobytes()


def test_the_last_two_checkpoints_are_kept_and_the_numbers_continue_after_a_restart(tmp_path: Path) -> None:
    for value in range(1, 4):
        folder_of(tmp_path).write(snapshot(value))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["checkpoint-000000000002", "checkpoint-000000000003"]
    assert value_in(folder_of(tmp_path)) == 3


def test_a_checkpoint_of_another_layout_is_kept_under_another_name(tmp_path: Path) -> None:
    folder_of(tmp_path, "theirs").write(snapshot(1))
    whole = (tmp_path / "checkpoint-000000000001").read_bytes()
    found, complaints = folder_of(tmp_path, "ours").newest()
    assert found is None
    kept = "unread-checkpoint-000000000001"
    assert complaints == [f"checkpoint-000000000001 is not used: its layout is theirs; it is kept as {kept}"]
    for value in range(2, 6):
        folder_of(tmp_path, "ours").write(snapshot(value))
    assert (tmp_path / kept).read_bytes() == whole
    assert value_in(folder_of(tmp_path, "ours")) == 5


def test_the_previous_checkpoint_is_used_when_the_newest_is_cut_at_any_byte(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    folder.write(snapshot(1))
    folder.write(snapshot(2))
    newest = tmp_path / "checkpoint-000000000002"
    whole = newest.read_bytes()
    for size in range(len(whole)):
        newest.write_bytes(whole[:size])
        assert value_in(folder) == 1
    newest.write_bytes(whole)
    assert value_in(folder) == 2


def test_the_previous_checkpoint_is_used_when_any_byte_of_the_newest_is_changed(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    folder.write(snapshot(1))
    folder.write(snapshot(2))
    newest = tmp_path / "checkpoint-000000000002"
    whole = newest.read_bytes()
    for place in range(len(whole)):
        newest.write_bytes(whole[:place] + bytes([whole[place] ^ 0x40]) + whole[place + 1 :])
        assert value_in(folder) == 1


class Disk:
    """File operations of this thread that fail from the one with the number `fails_at` on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, error: int, fails_at: int) -> None:
        self.tried = 0
        self._thread = threading.get_ident()
        self._error = error
        self._fails_at = fails_at
        for name in ("open", "write", "fsync", "replace"):
            monkeypatch.setattr(os, name, self._failing(getattr(os, name)))

    def _failing(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def operation(*arguments: Any) -> Any:
            if threading.get_ident() != self._thread:
                return real(*arguments)
            self.tried += 1
            if self.tried >= self._fails_at:
                raise OSError(self._error, os.strerror(self._error))
            return real(*arguments)

        return operation


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO])
def test_an_undamaged_checkpoint_exists_whichever_operation_of_writing_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: int
) -> None:
    folder = folder_of(tmp_path)
    folder.write(snapshot(1))
    for fails_at in count(1):
        with monkeypatch.context() as patch:
            disk = Disk(patch, error, fails_at)
            try:
                folder.write(snapshot(2))
            except OSError:
                pass
            else:
                break
        assert value_in(folder) == (1 if disk.tried <= WRITING else 2)
        assert not list(tmp_path.glob("*.part"))
    assert value_in(folder_of(tmp_path)) == 2
    assert fails_at == disk.tried + 1


def test_a_checkpoint_is_complete_when_each_write_takes_a_few_bytes_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, left: write(descriptor, left[:1000]))
    folder_of(tmp_path).write(snapshot(3))
    assert value_in(folder_of(tmp_path)) == 3
