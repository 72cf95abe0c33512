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
from dropanchor_service.checkpoints.format import Snapshot, UnreadableLayoutError
from dropanchor_service.estimation.columns import HYPOTHESIS
from dropanchor_service.estimation.fleet.frontend.attitude import ATTITUDE

WHOLE, CONTINUING = "whole", "continuing"
REPLACE = os.replace


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
    def as_present(found: str, content: Snapshot) -> Snapshot:
        if found != layout:
            raise UnreadableLayoutError(f"its layout is {found}")
        return content

    return CheckpointFolder(path, layout, as_present)


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


def many(moved: int, tags: int) -> Snapshot:
    """Return the poses of tags that stand, but for the first ones."""
    poses = np.zeros(tags, HYPOTHESIS)
    poses["row"], poses["x"][:moved] = np.arange(tags), np.random.default_rng(moved).normal(size=moved)
    return Snapshot({"poses": poses}, {"tags": [f"tag-{row}" for row in range(tags)]})


def test_whatever_changes_is_read_as_it_was_written(tmp_path: Path) -> None:
    folder, random = folder_of(tmp_path), np.random.default_rng(4)
    for _ in range(60):
        tags = int(random.integers(0, 40))
        written = many(int(random.integers(0, tags // 4 + 1)), tags)
        folder.write(written)
        found, complaints = folder_of(tmp_path).newest()
        assert complaints == []
        assert found is not None
        assert found.document == written.document
        assert found.arrays["poses"].tobytes() == written.arrays["poses"].tobytes()
    kinds = {path.name.partition("-since-")[1] for path in tmp_path.iterdir()}
    assert len(kinds) == 2, "both whole ones and others"


def test_what_is_written_grows_with_the_tags_that_move_not_with_those_there_are(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    whole = folder.write(many(0, 2000))
    assert folder.write(many(2, 2000)) < 1000
    sizes = [folder.write(many(2000, 2000)) for _ in range(20)]
    assert max(sizes) > whole
    assert sizes[-1] < 1000, "all have moved, so another whole one was written, and the next ones continue that"


def test_two_whole_checkpoints_are_kept_with_two_that_continue_each_and_the_numbers_go_on(tmp_path: Path) -> None:
    for value in (1, 10, 20, 30):
        folder = folder_of(tmp_path)
        for more in range(4):
            folder.write(snapshot(value + more))
    assert sorted(path.name.replace("0000000000", "") for path in tmp_path.iterdir()) == [
        "checkpoint-09",
        "checkpoint-11-since-09",
        "checkpoint-12-since-09",
        "checkpoint-13",
        "checkpoint-15-since-13",
        "checkpoint-16-since-13",
    ]
    for expected in (33, 32, 30, 23, 22, 20, None):
        assert value_in(folder_of(tmp_path)) == expected
        for path in sorted(tmp_path.glob("checkpoint-*"))[-1:]:
            path.unlink()


def test_a_checkpoint_is_whole_when_the_one_that_it_would_continue_was_deleted(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    folder.write(snapshot(1))
    for path in tmp_path.iterdir():
        path.unlink()
    folder.write(snapshot(2))
    assert value_in(folder_of(tmp_path)) == 2


def test_without_the_whole_one_those_that_continue_it_are_not_used(tmp_path: Path) -> None:
    folder_of(tmp_path).write(snapshot(1))
    folder = folder_of(tmp_path)
    for value in (2, 3):
        folder.write(snapshot(value))
    whole = tmp_path / "checkpoint-000000000002"
    whole.write_bytes(whole.read_bytes()[:-1])
    found, complaints = folder_of(tmp_path).newest()
    assert found is not None
    assert found.document["value"] == 1
    continuing = "checkpoint-000000000003-since-000000000002"
    damaged = "it is damaged (its checksum is wrong)"
    assert complaints == [
        f"{continuing} is not used: {whole.name}, which it continues, cannot be used: {damaged}",
        f"{whole.name} is not used: {damaged}",
    ]
    assert (tmp_path / continuing).exists(), "it is not damaged itself"
    assert not whole.exists()


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


@pytest.fixture(params=[WHOLE, CONTINUING])
def newest(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The newest of two checkpoints, whose values are 1 and 2."""
    folder = folder_of(tmp_path)
    folder.write(snapshot(1))
    (folder if request.param == CONTINUING else folder_of(tmp_path)).write(snapshot(2))
    return max(tmp_path.iterdir())


def test_the_previous_checkpoint_is_used_when_the_newest_is_cut_at_any_byte(newest: Path) -> None:
    whole = newest.read_bytes()
    for size in range(len(whole)):
        newest.write_bytes(whole[:size])
        assert value_in(folder_of(newest.parent)) == 1
    newest.write_bytes(whole)
    assert value_in(folder_of(newest.parent)) == 2


def test_the_previous_checkpoint_is_used_when_any_byte_of_the_newest_is_changed(newest: Path) -> None:
    whole = newest.read_bytes()
    for place in range(len(whole)):
        newest.write_bytes(whole[:place] + bytes([whole[place] ^ 0x40]) + whole[place + 1 :])
        assert value_in(folder_of(newest.parent)) == 1


class Disk:
    """File operations of this thread that fail from the one with the number `fails_at` on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, error: int, fails_at: int) -> None:
        self.tried = 0
        self.replaced = False
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
            self.replaced |= real is REPLACE
            return real(*arguments)

        return operation


@pytest.mark.parametrize("kind", [WHOLE, CONTINUING])
@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO])
def test_an_undamaged_checkpoint_exists_whichever_operation_of_writing_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: int, kind: str
) -> None:
    folder = folder_of(tmp_path)
    folder.write(snapshot(1))
    for fails_at in count(1):
        with monkeypatch.context() as patch:
            disk = Disk(patch, error, fails_at)
            try:
                (folder if kind == CONTINUING else folder_of(tmp_path)).write(snapshot(2))
            except OSError:
                pass
            else:
                break
        assert value_in(folder) == (2 if disk.replaced else 1)
        assert not list(tmp_path.glob("*.part"))
    assert value_in(folder_of(tmp_path)) == 2
    assert fails_at == disk.tried + 1 > 5


def test_a_checkpoint_is_complete_when_each_write_takes_a_few_bytes_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, left: write(descriptor, left[:1000]))
    folder_of(tmp_path).write(snapshot(3))
    assert value_in(folder_of(tmp_path)) == 3
