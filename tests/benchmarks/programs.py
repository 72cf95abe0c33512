"""The processes of a measurement: router, generator, receiver. Each is ended with the block that started it."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from support.commands import environment
from support.zenoh_router import start_router_process

ROOT = Path(__file__).parents[2]
SESSIONS = 24


class Program:
    """One of this folder, once it has said that it is ready."""

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

    def tell(self, line: object) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def ask(self, line: object) -> str:
        self.tell(line)
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def end(self) -> None:
        end(self.process)


def end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()


@contextmanager
def running(name: str, *arguments: object) -> Iterator[Program]:
    program = Program(name, *arguments)
    try:
        yield program
    finally:
        program.end()


def generator(
    endpoint: str, tags: int, duration_s: float, first: int = 0, control: str = "block", register: int = 0
) -> Program:
    return Program("generator", endpoint, first, tags, SESSIONS, duration_s, control, register)


@contextmanager
def router(endpoint: str) -> Iterator[subprocess.Popen[str]]:
    process = start_router_process(endpoint)
    try:
        yield process
    finally:
        end(process)
