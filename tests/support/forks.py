"""Start `dropanchor` as a fork of a process that has imported it and loaded its kernels: nine tenths of a start's cost.

Each program is a process of its own. Only imports and kernels are shared, and nothing else of it runs before the fork.
It does not inherit the limits of this process.
"""

import atexit
import functools
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import Any

from support.commands import environment

_PROGRAM = """
import gc, json, os, runpy, socket, sys
import dropanchor_service.cli, dropanchor_service.commands.api, dropanchor_service.commands.serve
from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.engines.compiled import compiled_engine
from dropanchor_service.settings.model import Settings

compiled_engine(Settings(engine="fleet"), CompilationProgress())
asked = socket.socket(fileno=int(sys.argv[1]))
gc.collect()
gc.freeze()
while True:
    text, files, _, _ = socket.recv_fds(asked, 1_000_000, 2)
    if not text:
        break
    request = json.loads(text)
    if "ended" in request:
        answer = os.waitstatus_to_exitcode(os.waitpid(request["ended"], 0)[1])
    else:
        answer = os.fork()
    if not answer and "words" in request:
        exec(request["before"])
        asked.close()
        for number, file in enumerate(files, 1):
            os.dup2(file, number)
            os.close(file)
        os.chdir(request["folder"])
        os.environ.clear()
        os.environ.update(request["environment"])
        sys.argv[1:] = request["words"]
        runpy.run_module("dropanchor_service", run_name="__main__", alter_sys=True)
    for file in files:
        os.close(file)
    asked.send(b"%d" % answer)
"""
_READ_AT_IMPORT = ("LD_", "MALLOC_", "NUMBA_", "OMP_", "OPENBLAS_", "PYTHON", "ZENOH_")
_ENVIRONMENT = environment()  # before any test changes it, whichever comes first


class Forked:
    """A running program. It has of `subprocess.Popen` what tests need."""

    def __init__(self, server: "Server", pid: int, stderr: int) -> None:
        self._server, self._lock = server, threading.Lock()
        self._ends = os.pidfd_open(pid)
        self.pid, self.stderr = pid, os.fdopen(stderr)
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return the exit code, None while it runs."""
        with self._lock:
            if self.returncode is None and select.select([self._ends], [], [], 0.0)[0]:
                self.returncode = self._server.ask({"ended": self.pid})
                os.close(self._ends)
            return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.poll() is None:
            select.select([self._ends], [], [], timeout)
        if (code := self.poll()) is None:
            raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0.0)
        return code

    def send_signal(self, how: signal.Signals) -> None:
        if self.poll() is None:
            os.kill(self.pid, how)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Server:
    """The process that forks. Of its environment the forks have what is read by imports."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._socket, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            program = [sys.executable, "-c", _PROGRAM, str(its.fileno())]
            self._process = subprocess.Popen(program, pass_fds=[its.fileno()], env=_ENVIRONMENT)

    def close(self) -> None:
        self._socket.close()
        self._process.wait()

    def start(self, words: Sequence[str], environment: dict[str, str], before: str, stdout: int) -> Forked:
        """Run `dropanchor` with these words, and a program in it before."""
        reading, writing = os.pipe()
        request = {"words": list(words), "folder": os.getcwd(), "environment": environment, "before": before}
        pid = self.ask(request, stdout, writing)
        os.close(writing)
        return Forked(self, pid, reading)

    def ask(self, request: dict[str, Any], *files: int) -> int:
        with self._lock:
            socket.send_fds(self._socket, [json.dumps(request).encode()], files)
            return int(self._socket.recv(64))


def read_at_import(environment: dict[str, str]) -> dict[str, str]:
    return {name: value for name, value in environment.items() if name.startswith(_READ_AT_IMPORT)}


@functools.cache
def _server() -> Server:
    server = Server()
    atexit.register(server.close)
    return server


def can_be_forked() -> bool:
    """Return whether what imports read of the environment is the same as for the other programs."""
    return read_at_import(environment()) == read_at_import(_ENVIRONMENT)


def start_forked(words: Sequence[str], environment: dict[str, str], before: str = "", stdout: int = 1) -> Forked:
    """Run `dropanchor` with these words in a process of its own. before: a program that runs there before it.

    stdout: a file of this process.
    """
    return _server().start(words, environment, before, stdout)
