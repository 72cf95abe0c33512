"""The first start compiles in a process of its own."""

import logging
import os
import shutil
from pathlib import Path

import pytest

from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.engines.compile_apart import compile_apart, mark_complete
from dropanchor_service.runtime import kernel_cache
from dropanchor_service.runtime.kernel_cache import VARIABLE, is_full, mark_of
from service.data_folder import full_disk
from support.kernel_cache import compile_once
from support.service import environment


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache with all kernels, of which nothing says that it is full."""
    compile_once()
    folder = tmp_path / "cache"
    shutil.copytree(os.environ[VARIABLE], folder, ignore=shutil.ignore_patterns("complete-*"))
    for name, value in environment(**{VARIABLE: str(folder)}).items():
        monkeypatch.setenv(name, value)
    return folder


def test_a_cache_is_filled_once(cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    progress = CompilationProgress("http://here/")
    compile_apart(progress)
    (mark,) = cache.glob("complete-*")
    first, last = caplog.messages[0], caplog.messages[-1]
    assert "http://here/ shows the progress" in first
    assert str(cache) in last
    assert progress.sentence == "The service is starting."
    caplog.clear()
    compile_apart(progress)
    assert caplog.messages == []
    mark.unlink()
    compile_apart(progress)
    assert mark.exists()


def test_a_failure_leaves_the_compiling_to_the_caller(
    cache: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.DEBUG)
    monkeypatch.setattr("sys.executable", shutil.which("false"))
    compile_apart(CompilationProgress())
    assert list(cache.glob("complete-*")) == []
    assert not any("compiled in" in message for message in caplog.messages)


def test_a_compiler_that_cannot_be_started_is_a_sentence_and_leaves_the_compiling_to_the_caller(
    cache: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.executable", str(cache / "nowhere"))
    progress = CompilationProgress()
    compile_apart(progress)
    assert "the service compiles by itself" in caplog.messages[-1]
    assert "No such file" in caplog.messages[-1]
    assert progress.sentence == "The service is starting."


def test_a_cache_without_room_is_not_filled(cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    with full_disk():
        compile_apart(CompilationProgress())
        assert not mark_complete()
    assert caplog.messages == [f"{cache} has no room for the compiled estimator: what it lacks is compiled into memory"]
    assert list(cache.glob("complete-*")) == []


def test_a_cache_with_damaged_files_is_not_full(cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert mark_complete()
    assert is_full(cache)
    first, second = sorted(cache.glob("*/*.nbc"))[:2]
    first.write_bytes(b"")
    second.chmod(0o666)
    assert not is_full(cache)
    assert caplog.messages == [f"2 files of the compiled estimator in {cache} are damaged, and are made anew"]
    assert not first.exists()
    assert not second.exists()


def test_a_cache_is_full_for_one_place_and_one_processor_and_for_the_same_sources_written_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """numba finds compiled code by the folder of a source, and compares what the source says."""
    package = Path(kernel_cache.__file__).parents[1]
    for name in kernel_cache.KERNEL_SOURCES:
        shutil.copytree(package / name, tmp_path / name)
    here = mark_of(tmp_path)
    monkeypatch.setattr(kernel_cache, "__file__", str(tmp_path / "runtime" / "kernel_cache.py"))
    moved = mark_of(tmp_path)
    os.utime(next((tmp_path / "zones").glob("*.py")), (1, 1))
    assert mark_of(tmp_path) == moved != here
    monkeypatch.setenv("NUMBA_CPU_NAME", "another")
    assert mark_of(tmp_path) != moved
    monkeypatch.undo()
    assert mark_of(tmp_path) == here
