"""Packages of npm that a test needs. They are downloaded once per run and never stored in the repository."""

import shutil
import subprocess
from pathlib import Path

import pytest

TIMEOUT_S = 240.0


def install(folder: Path, *packages: str) -> None:
    """Install packages into a folder. Skip the test where npm, node or their registry is missing."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("npm and node are not installed: this test runs a client in TypeScript")
    (folder / "package.json").write_text('{"private": true, "type": "module"}')
    command = [npm, "install", "--silent", "--no-audit", "--no-fund", *packages]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        pytest.skip(f"npm did not deliver {packages} within {TIMEOUT_S:.0f} s")
    if done.returncode:
        pytest.skip(f"npm did not deliver {packages}: {done.stderr.strip()[-300:]}")
