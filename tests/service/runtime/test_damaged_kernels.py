"""Whatever happens to a file of compiled code, it is not run: the kernel is compiled anew, and its result is right."""

import importlib.util
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from numba.core import config

from dropanchor_service.runtime import numba_cache
from dropanchor_service.runtime.kernel_files import damaged_in, digest
from service.data_folder import NOBODY, full_disk

KERNEL = "from numba import njit\n\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n"


class Planted:
    """Unpickled, it makes a file."""

    def __init__(self, sign: Path) -> None:
        self.sign = sign

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (self.sign,)


def empty(path: Path) -> None:
    path.write_bytes(b"")


def halve(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 0x01
    path.write_bytes(whole)


def cut_the_digest_off(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-32])


def make_unreadable(path: Path) -> None:
    path.unlink()
    path.mkdir()


def plant(path: Path) -> None:
    content = pickle.dumps(Planted(path.parents[1] / "ran"))
    path.write_bytes(content + digest(content))


def plant_as_another_user(path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can give a file away")
    plant(path)
    os.chown(path, NOBODY, NOBODY)


def plant_where_others_can_write(path: Path) -> None:
    plant(path)
    path.chmod(0o777)


FAULTS = [empty, halve, flip, cut_the_digest_off, plant_as_another_user, plant_where_others_can_write]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, and beside it a module with a kernel."""
    (tmp_path / "small.py").write_text(KERNEL)
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    numba_cache._say_not_kept.cache_clear()
    return tmp_path / "cache"


def is_loaded(folder: Path) -> bool:
    """Run the kernel as a new process does. Return whether it came out of the cache."""
    spec = importlib.util.spec_from_file_location("small", folder.with_name("small.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.twice(4) == 8
    return bool(module.twice.stats.cache_hits)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_file_that_cannot_be_trusted_is_compiled_anew(
    folder: Path, suffix: str, fault: Callable[[Path], None]
) -> None:
    assert not is_loaded(folder)
    assert is_loaded(folder)
    (file,) = folder.glob(f"*/*.{suffix}")
    fault(file)
    assert damaged_in(folder) == [file]
    assert not is_loaded(folder)
    assert not (folder / "ran").exists()
    assert damaged_in(folder) == []
    assert is_loaded(folder)


def test_a_planted_file_would_run_if_it_were_trusted(folder: Path) -> None:
    is_loaded(folder)
    (file,) = folder.glob("*/*.nbi")
    plant(file)
    is_loaded(folder)
    assert (folder / "ran").is_dir()


@pytest.mark.parametrize("fault", [None, *FAULTS[:4], make_unreadable])
def test_without_room_a_kernel_runs_from_memory(
    folder: Path, caplog: pytest.LogCaptureFixture, fault: Callable[[Path], None] | None
) -> None:
    if fault is not None:
        is_loaded(folder)
        fault(next(folder.glob("*/*.nbc")))
    with full_disk():
        assert not is_loaded(folder)
        assert not is_loaded(folder)
    assert [message for message in caplog.messages if "cannot be kept (File too large)" in message] == caplog.messages
    assert len(caplog.messages) == 1


def test_files_are_for_nobody_else_to_write_whatever_the_umask(folder: Path) -> None:
    before = os.umask(0)
    try:
        is_loaded(folder)
    finally:
        os.umask(before)
    assert is_loaded(folder)
    assert [path for path in folder.rglob("*") if path.stat().st_mode & 0o022] == []
