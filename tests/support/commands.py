"""Run Python programs of this repository in processes of their own."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

_ROOT = Path(__file__).parents[2]
_PACKAGES = os.pathsep.join(str(_ROOT / name) for name in ("schemas", "tag_client", "service", "service/evaluation"))

_CALLS = """
import contextlib, importlib, io, json, sys
main = importlib.import_module(f"{sys.argv[1]}.cli").main
ended = []
for words in json.load(sys.stdin):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(words)
        except SystemExit as end:
            code = end.code or 0
    ended.append((code, out.getvalue(), err.getvalue()))
json.dump(ended, sys.stdout)
"""


class Ended(NamedTuple):
    """What a call of a command left behind."""

    returncode: int
    stdout: str
    stderr: str


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


def called(package: str, calls: Sequence[Sequence[str]]) -> list[Ended]:
    """Return what the program of a package answers to each of these words, one after the other in one new process.

    A process for each of them would import the same modules again.
    """
    ended = python("-c", _CALLS, package, text_input=json.dumps([list(words) for words in calls]))
    assert ended.returncode == 0, ended.stderr
    return [Ended(*one) for one in json.loads(ended.stdout)]
