"""Compiled kernels and their cache."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dropanchor_service.runtime.kernel_cache import VARIABLE, use_kernel_cache
from support.service import ROOT, environment

PLACE = (
    "import os; from dropanchor_service.runtime.kernel_cache import *; use_kernel_cache(); print(os.environ[VARIABLE])"
)


def place(**variables: str) -> str:
    clean = {name: value for name, value in environment(**variables).items() if name != VARIABLE}
    return subprocess.run([sys.executable, "-c", PLACE], env=clean, check=True, text=True, capture_output=True).stdout


def test_the_cache_lies_with_the_users_others_and_is_named_after_the_sources(tmp_path: Path) -> None:
    first = place(XDG_CACHE_HOME=str(tmp_path))
    assert first.startswith(str(tmp_path / "dropanchor" / "kernels-"))
    assert place(XDG_CACHE_HOME=str(tmp_path)) == first


def test_a_cache_that_cannot_be_written_is_replaced_by_a_fresh_folder_of_our_own(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    first, second = place(XDG_CACHE_HOME=str(blocked)), place(XDG_CACHE_HOME=str(blocked))
    assert "dropanchor-kernels-" in first
    assert first != second
    assert os.stat(first.strip()).st_mode & 0o077 == 0


def test_what_the_environment_says_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "somewhere")
    use_kernel_cache()
    assert os.environ[VARIABLE] == "somewhere"


def test_nothing_is_left_to_be_compiled_or_imported_while_samples_come_in() -> None:
    path = f"{environment()['PYTHONPATH']}{os.pathsep}{ROOT / 'tests'}"
    command = [sys.executable, "-m", "support.compiled_later"]
    ended = subprocess.run(command, env=environment(PYTHONPATH=path), check=True, text=True, capture_output=True)
    assert json.loads(ended.stdout) == []
