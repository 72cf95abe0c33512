"""Run the build backend."""

import os
import subprocess
import sys
from pathlib import Path


class BuildError(Exception):
    """The build backend failed. The message is what it wrote."""


def hatch(target: str, folder: Path, into: Path, time_s: int) -> None:
    """Build in this environment, whose versions constraints.txt fixes. It needs no network."""
    words = [sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", str(into.absolute())]
    environment = os.environ | {"SOURCE_DATE_EPOCH": str(time_s)}
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BuildError(f"{folder}: {done.stderr}")
