"""Reads reports from a port for ever: wakes a silent module, and comes back when it was unplugged."""

import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator

import serial

from dropanchor_tag_client.sources.modules.catalogue import Module
from dropanchor_tag_client.sources.modules.detect import Arrived, detect, read, write
from dropanchor_tag_client.sources.modules.port import PortError, open_port
from dropanchor_tag_client.sources.modules.report import Drop, Parser, Report

# A resting DWM1001 may report every 10 s, and `lec` sent twice would stop it: the second attempt comes later than that.
_WAKE_AFTER_S, _WAKE_AGAIN_S = 2.0, 15.0
_RETRY_S, _MAX_RETRY_S = 0.2, 5.0


class Reader:
    """The reports of one port. dropped: what was left out so far, by reason. raw_bytes: read so far."""

    def __init__(
        self, port: str, module: Module | None, baud: int | None, start: str | None, say: Callable[[str], None]
    ) -> None:
        """module: None to find out. start: a command that wakes the module instead of its usual one."""
        self.dropped: Counter[Drop] = Counter()
        self.raw_bytes = 0
        self._name, self._module, self._baud, self._start, self._say = port, module, baud, start, say

    @property
    def module(self) -> Module | None:
        return self._module

    def reports(self) -> Iterator[Arrived]:
        """Yield (time of arrival in ns UTC, what arrived) at least a few times per second. Raises PortError when the
        port cannot be opened at first."""
        port = self._open()
        yield time.time_ns(), []
        while True:
            try:
                with port:
                    yield from self._talk(port)
            except (serial.SerialException, OSError):
                self._say(f"{self._name} does not answer any more: was it unplugged? Trying again until it does.")
            port = yield from self._reopened()
            self._say(f"{self._name} is back.")

    def _open(self) -> serial.Serial:
        return open_port(self._name, self._baud or (self._module.baud if self._module else 115_200))

    def _reopened(self) -> Generator[Arrived, None, serial.Serial]:
        retry_s = _RETRY_S
        while True:
            yield from _pause(retry_s)
            try:
                return self._open()
            except PortError as error:
                self._say(str(error))
            retry_s = min(2 * retry_s, _MAX_RETRY_S)

    def _talk(self, port: serial.Serial) -> Iterator[Arrived]:
        port.read(port.in_waiting)  # what waited has no time
        if self._module is None:
            self._module = yield from detect(port, self._baud, self._say)
            self._say(f"{self._name}: {self._module.name} found.")
        parser, wake = self._module.parser(), self._wake(self._module)
        heard_s, patience_s = time.monotonic(), _WAKE_AFTER_S
        while True:
            data = read(port)
            found = self._parse(parser, data)
            yield time.time_ns(), found
            if found:
                heard_s, patience_s = time.monotonic(), _WAKE_AGAIN_S
            elif time.monotonic() - heard_s > patience_s:
                heard_s, patience_s = time.monotonic(), _WAKE_AGAIN_S
                self._say(f"{self._name}: {self._module.name} reports nothing. {self._module.hint}")
                yield from write(port, wake)

    def _wake(self, module: Module) -> tuple[bytes, ...]:
        return module.wake if self._start is None else (self._start.encode() + b"\r\n",)

    def _parse(self, parser: Parser, data: bytes) -> list[Report]:
        self.raw_bytes += len(data)
        found = parser.feed(data)
        self.dropped.update(parser.dropped)
        parser.dropped.clear()
        return found


def _pause(seconds: float) -> Iterator[Arrived]:
    """Wait, but let the caller do its work a few times per second."""
    end_s = time.monotonic() + seconds
    while (left_s := end_s - time.monotonic()) > 0:
        time.sleep(min(left_s, 0.1))
        yield time.time_ns(), []
