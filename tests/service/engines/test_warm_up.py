"""Kernels are compiled in advance and cached."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dropanchor_service.runtime.kernel_cache import KERNEL_SOURCES, VARIABLE, use_kernel_cache
from support.service import ROOT, environment

PRINT_FOLDER = (
    "import os; from dropanchor_service.runtime.kernel_cache import *; use_kernel_cache(); print(os.environ[VARIABLE])"
)


def cache_folder(**variables: str) -> str:
    clean = {name: value for name, value in environment(**variables).items() if name != VARIABLE}
    return subprocess.run(
        [sys.executable, "-c", PRINT_FOLDER], env=clean, check=True, text=True, capture_output=True
    ).stdout


def test_the_cache_lies_in_the_users_cache_folder_and_is_named_after_the_sources(tmp_path: Path) -> None:
    first = cache_folder(XDG_CACHE_HOME=str(tmp_path))
    assert first.startswith(str(tmp_path / "dropanchor" / "kernels-"))
    assert cache_folder(XDG_CACHE_HOME=str(tmp_path)) == first


def test_the_name_depends_on_every_package_with_kernels() -> None:
    """The kernels of the evaluation call none of other files, so numba sees their changes by itself."""
    package, evaluation = ROOT / "service/dropanchor_service", ROOT / "service/evaluation/dropanchor_evaluation"
    of_packages = {source for name in KERNEL_SOURCES for source in (package / name).rglob("*.py")}
    assert len(with_kernels(package)) > 10
    assert with_kernels(package) <= of_packages
    assert with_kernels(evaluation) == {evaluation / name for name in ("bounds/recursion.py", "paper/compiled.py")}


def with_kernels(package: Path) -> set[Path]:
    return {source for source in package.rglob("*.py") if "njit(" in source.read_text()}


def test_a_cache_folder_in_the_environment_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "somewhere"))
    use_kernel_cache()
    assert os.environ[VARIABLE] == str(tmp_path / "somewhere")


def test_nothing_is_compiled_or_imported_while_samples_are_processed() -> None:
    path = f"{environment()['PYTHONPATH']}{os.pathsep}{ROOT / 'tests'}"
    command = [sys.executable, "-m", "support.compiled_later"]
    ended = subprocess.run(command, env=environment(PYTHONPATH=path), check=True, text=True, capture_output=True)
    assert json.loads(ended.stdout) == []
