"""The processes of a measurement: router, generator and receiver."""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from support.commands import environment
from support.zenoh_router import start_router_process

ROOT = Path(__file__).parents[2]
SESSIONS = 24


class Program:
    """A program of this folder that has printed "ready"."""

    def __init__(self, name: str, *arguments: object) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", f"benchmarks.{name}", *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment() | {"PYTHONPATH": f"{environment()['PYTHONPATH']}:{ROOT / 'tests'}"},
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n", f"{name} did not start"

    def send_line(self, line: object) -> None:
        """Write a line to the stdin of the program."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def request(self, line: object) -> str:
        """Write a line to the program and return its next line."""
        self.send_line(line)
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def end(self) -> None:
        end(self.process)


def end(process: subprocess.Popen[str]) -> None:
    """Kill a process and close its pipes."""
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()


@contextmanager
def running(name: str, *arguments: object) -> Iterator[Program]:
    """Run a program of this folder until the block ends."""
    program = Program(name, *arguments)
    try:
        yield program
    finally:
        program.end()


def generator(
    endpoint: str,
    tags: int,
    duration_s: float,
    first: int = 0,
    control: str = "block",
    register: int = 0,
    sites: Sequence[str] = ("default",),
) -> Program:
    """Start a load generator. The caller ends it. register: number of tags to register before."""
    return Program("generator", endpoint, first, tags, SESSIONS, duration_s, control, register, *sites)


@contextmanager
def router(endpoint: str) -> Iterator[subprocess.Popen[str]]:
    """Run a Zenoh router until the block ends."""
    process = start_router_process(endpoint)
    try:
        yield process
    finally:
        end(process)
