"""The router of a cell as a process that dies and is started again: `dropanchor router`."""

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager

from support.commands import environment
from support.service import command


class RouterCell:
    """A router that listens at the endpoint, whoever can reach it."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self._process = self._started()

    def _started(self) -> "subprocess.Popen[str]":
        words = command("router", "--zenoh-listen", self.endpoint, "--insecure")
        process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment())
        assert process.stderr is not None
        assert any("ready at" in line for line in process.stderr), "the router did not start"
        return process

    @property
    def process(self) -> int:
        return self._process.pid

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()

    def restart_after(self, gone_s: float) -> None:
        """Kill it, and start it again so much later."""
        self.kill()
        time.sleep(gone_s)
        self._process = self._started()


@contextmanager
def running_cell(endpoint: str) -> Iterator[RouterCell]:
    """Run a router until the block ends."""
    cell = RouterCell(endpoint)
    try:
        yield cell
    finally:
        cell.kill()
