"""Run Python programs of this repository in processes of their own."""

import os
import subprocess
import sys
from pathlib import Path

_ROOT = Path(__file__).parents[2]
_PACKAGES = os.pathsep.join(str(_ROOT / name) for name in ("schemas", "tag_client", "service", "service/evaluation"))


def environment() -> dict[str, str]:
    """Return the environment of this process, with the packages of the checkout on the import path."""
    return os.environ | {"PYTHONPATH": _PACKAGES}


def python(
    *arguments: str, text_input: str | None = None, timeout_s: float = 240.0
) -> subprocess.CompletedProcess[str]:
    """Run `python ARGUMENTS` until it exits."""
    return subprocess.run(
        [sys.executable, *arguments],
        input=text_input,
        capture_output=True,
        text=True,
        env=environment(),
        timeout=timeout_s,
        check=False,
    )


def start_python(*arguments: str) -> subprocess.Popen[str]:
    """Start `python ARGUMENTS`. The caller ends it."""
    return subprocess.Popen(
        [sys.executable, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
