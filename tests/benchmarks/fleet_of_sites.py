"""Tags of many sites that publish until they are told to pause; see the program `cached_tags`."""

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from benchmarks.programs import Program, running


class FleetOfSites:
    """numbers: of the messages that every tag has sent, as of the last pause. late_p99_ms: of their bursts."""

    def __init__(self, program: Program) -> None:
        self.start_ns = time.time_ns() // 1000 * 1000 + 1_000_000_000
        self.numbers: list[int] = []
        self.late_p99_ms = 0.0
        self._program = program
        program.send_line(self.start_ns)

    @property
    def process(self) -> int:
        return self._program.process.pid

    def go(self) -> None:
        self._program.send_line("go")

    def pause(self) -> None:
        report = json.loads(self._program.request("pause"))
        self.numbers = [number for first, end in report["sent"] for number in range(first, end)]
        self.late_p99_ms = report["late_p99_ms"]


@contextmanager
def running_fleet(endpoint: str, tags: int, sites: Sequence[str]) -> Iterator[FleetOfSites]:
    """Run so many tags of each site until the block ends. They do not publish yet."""
    with running("cached_tags", endpoint, tags, *sites) as program:
        yield FleetOfSites(program)
