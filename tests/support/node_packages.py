"""Packages of npm. They are downloaded and never stored in the repository."""

import shutil
import subprocess
from pathlib import Path

import pytest

TIMEOUT_S = 240.0


def install(folder: Path, *packages: str) -> None:
    """Install packages into a folder. Skip the test where npm, node or their registry is missing."""
    problem = problem_of_install(folder, *packages)
    if problem is not None:
        pytest.skip(problem)


def problem_of_install(folder: Path, *packages: str) -> str | None:
    """Install packages into a folder. Return why that is not possible, None if it was."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        return f"npm and node are not installed: {', '.join(packages)} cannot be had"
    (folder / "package.json").write_text('{"private": true, "type": "module"}')
    command = [npm, "install", "--silent", "--no-audit", "--no-fund", "--no-package-lock", *packages]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        return f"npm did not deliver {', '.join(packages)} within {TIMEOUT_S:.0f} s"
    return f"npm did not deliver {', '.join(packages)}: {done.stderr.strip()[-300:]}" if done.returncode else None
