"""Kernels that were compiled elsewhere are used where they are for this process, and nowhere else."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import dropanchor_service
from dropanchor_service.runtime.kernel_cache import VARIABLE, sources_digest
from dropanchor_service.runtime.shipped_kernels import (
    MADE_FOR,
    PACKAGE,
    X86_64_V3,
    collect,
    copy_shipped,
    family,
    made_for,
)
from support.kernel_cache import compile_once
from support.service import environment

SOURCES = Path(dropanchor_service.__file__).parent
COMPILED = "import dropanchor_service.cli as cli; cli.main(['compile'])"
V3 = "fpu sse2 ssse3 fma cx16 sse4_2 movbe avx f16c lahf_lm abm bmi1 avx2 bmi2"


@pytest.fixture
def distribution(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The installed distribution, with all kernels of these sources."""
    if family() is None:
        pytest.skip("this processor belongs to no family that is known")
    compile_once()
    folder = tmp_path / "site" / PACKAGE
    folder.parent.mkdir()
    collect(Path(os.environ[VARIABLE]), folder, made_for(sources_digest(), family()), SOURCES)
    (folder / "__init__.py").touch()
    for place in (*folder.iterdir(), folder):  # as an administrator installs it
        place.chmod(0o555 if place.is_dir() else 0o444)
    monkeypatch.syspath_prepend(str(folder.parent))
    return folder


def started(tmp_path: Path, home: str = "home") -> str:
    """Run a command that compiles what is missing, in a home without a cache. Return what it says."""
    paths = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
    variables = environment(XDG_CACHE_HOME=str(tmp_path / home), PYTHONPATH=paths)
    clean = {name: value for name, value in variables.items() if name != VARIABLE}
    words = [sys.executable, "-c", COMPILED]
    done = subprocess.run(words, env=clean, capture_output=True, text=True, check=True)
    return done.stdout + done.stderr


def test_with_the_distribution_nothing_is_compiled(distribution: Path, tmp_path: Path) -> None:
    assert "compil" not in started(tmp_path).lower()
    (cache,) = (tmp_path / "home" / "dropanchor").iterdir()
    assert len(list(cache.glob("complete-*"))) == 1
    assert {file.name for file in distribution.rglob("*.nbc")} == {file.name for file in cache.rglob("*.nbc")}


@pytest.mark.usefixtures("distribution")
def test_with_the_distribution_nothing_is_compiled_where_no_folder_keeps_it(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert "compil" not in started(tmp_path, "file").lower()


@pytest.mark.parametrize("part", ["sources", "numba", "Python", X86_64_V3])
def test_kernels_for_something_else_are_not_used(distribution: Path, tmp_path: Path, part: str) -> None:
    needs = made_for(sources_digest(), family())
    assert part in needs
    (distribution / MADE_FOR).chmod(0o644)
    (distribution / MADE_FOR).write_text(needs.replace(part, f"{part}x"))
    assert not copy_shipped(tmp_path / "cache", needs, SOURCES)
    assert not (tmp_path / "cache").exists()


def test_without_the_distribution_nothing_is_copied(tmp_path: Path) -> None:
    assert not copy_shipped(tmp_path / "cache", made_for(sources_digest(), family()), SOURCES)


@pytest.mark.parametrize(
    ("flags", "expected"),
    [(V3, X86_64_V3), (V3.replace("fma ", ""), None), (V3.replace(" bmi2", ""), None), ("", None)],
)
def test_the_family_is_what_the_processor_can_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flags: str, expected: str | None
) -> None:
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    (tmp_path / "cpuinfo").write_text(f"processor\t: 0\nflags\t\t: {flags}\n")
    assert family(tmp_path / "cpuinfo") == expected
    assert family(tmp_path / "nowhere") is None
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    assert family(tmp_path / "cpuinfo") is None


@pytest.mark.usefixtures("distribution")
def test_a_cache_that_cannot_take_the_kernels_is_no_reason_to_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dropanchor_service.runtime import kernel_cache

    def full(*_: object, **__: object) -> None:
        raise OSError("No space left on device")

    monkeypatch.setattr(shutil, "copyfile", full)
    monkeypatch.setattr("os.environ", {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "home")})
    os.environ.pop(VARIABLE, None)
    kernel_cache.use_kernel_cache()
    assert list(Path(os.environ[VARIABLE]).glob("complete-*")) == []
