"""Read the reports of a module from a port. Start a silent module, and continue after it was unplugged."""

import itertools
import time
from collections.abc import Callable, Generator, Iterator

import serial

from dropanchor_tag_client.sources.modules.detect import Arrived, detect, read, write
from dropanchor_tag_client.sources.modules.heard import Heard
from dropanchor_tag_client.sources.modules.module import Module
from dropanchor_tag_client.sources.modules.port import PortError, open_port
from dropanchor_tag_client.sources.modules.recognise import recognised
from dropanchor_tag_client.sources.modules.report import Dropped, Parser, Report

# A DWM1001 at rest may report only every 10 s, and a second `lec` would stop it: wait longer before the second attempt.
_START_AFTER_S, _RESTART_AFTER_S = 2.0, 15.0
_RETRY_S, _MAX_RETRY_S = 0.2, 5.0
_POLL_S = 0.1


class Reader:
    """The reports of one port. dropped: counts of what was left out, by reason. raw_bytes: count of bytes read."""

    def __init__(
        self,
        port: str,
        module: Module | None,
        baud: int | None,
        start: str | None,
        poll: tuple[bytes, ...],
        log: Callable[[str], None],
    ) -> None:
        """module: None to detect it. start: a command that starts the reports, instead of the usual one. poll: commands
        for a module that measures only when asked, instead of the usual ones. log: takes messages for the user."""
        self.dropped = Dropped()
        self.raw_bytes = 0
        self._heard = Heard()
        self._reported = False
        self._may_write = module is not None or start is not None
        self._name, self._module, self._baud, self._start, self._poll, self._log = port, module, baud, start, poll, log

    @property
    def module(self) -> Module | None:
        return self._module

    def reports(self) -> Iterator[Arrived]:
        """Yield (time of arrival in ns UTC, reports) at least a few times per second.

        Raises PortError if the port cannot be opened at first.
        """
        port = self._open()
        yield time.time_ns(), []
        while True:
            try:
                with port:
                    yield from self._read_port(port)
            except (serial.SerialException, OSError):
                self._log(f"{self._name} does not answer any more: was it unplugged? Trying again until it does.")
            port = yield from self._reopened()
            self._log(f"{self._name} is back.")

    def _open(self) -> serial.Serial:
        return open_port(self._name, self._baud or (self._module.baud if self._module else 115_200))

    def _reopened(self) -> Generator[Arrived, None, serial.Serial]:
        retry_s = _RETRY_S
        while True:
            yield from _pause(retry_s)
            try:
                return self._open()
            except PortError as error:
                self._log(str(error))
            retry_s = min(2 * retry_s, _MAX_RETRY_S)

    def _read_port(self, port: serial.Serial) -> Iterator[Arrived]:
        port.read(port.in_waiting)  # the time of older data is unknown
        if self._module is None:
            self._module = yield from detect(port, self._baud, self._log)
            self._log(f"{self._name}: {self._module.name} found.")
        parser, poll = self._module.parser(), _Poll(self._poll or self._module.poll)
        last_s, max_silence_s = time.monotonic(), _START_AFTER_S
        while True:
            found = self._parse(parser, read(port))
            yield time.time_ns(), found
            poll.write(port)
            if found:
                last_s, max_silence_s = time.monotonic(), _RESTART_AFTER_S
            elif time.monotonic() - last_s > max_silence_s:
                last_s, max_silence_s = time.monotonic(), _RESTART_AFTER_S
                if (other := self._other_module()) is not None:
                    self._log(
                        f"{self._name}: {self._module.name} understands nothing here, {other.name} does: using it."
                    )
                    self._module = other
                    parser, poll = other.parser(), _Poll(self._poll or other.poll)
                    continue
                self._log(f"{self._name}: {self._silence(self._module, port.baudrate)}")
                if self._may_write or not self._heard.count:  # a module that nobody named may be another one by now
                    yield from write(port, self._start_commands(self._module))

    def _other_module(self) -> Module | None:
        """Return the module that understands what arrived, where the one that was named never did."""
        return None if self._reported or not self._heard.count else recognised(self._heard.last)

    def _silence(self, module: Module, baud: int) -> str:
        """Return why there is no report: nothing arrives, or nothing that the module is known to print."""
        count = self._heard.count
        if not count:
            return f"{module.name} reports nothing. {module.hint}"
        without = f"{module.name} finds no range in the {count} bytes that arrived"
        return f"{without}. {module.hint} The last of them: {self._heard.sentence(baud)}"

    def _start_commands(self, module: Module) -> tuple[bytes, ...]:
        return module.start_commands if self._start is None else (self._start.encode() + b"\r\n",)

    def _parse(self, parser: Parser, data: bytes) -> list[Report]:
        self.raw_bytes += len(data)
        found = parser.feed(data)
        self.dropped.update(parser.dropped)
        self.dropped.line = parser.dropped.line
        parser.dropped.clear()
        self._heard.add(data)
        if found:
            self._reported = True
            self._heard.clear()
        return found


class _Poll:
    """Commands that are written in turn to a module that measures only when it is asked."""

    def __init__(self, commands: tuple[bytes, ...]) -> None:
        self._commands = itertools.cycle(commands) if commands else None
        self._next_s = 0.0

    def write(self, port: serial.Serial) -> None:
        if self._commands is not None and time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + _POLL_S
            port.write(next(self._commands))


def _pause(seconds: float) -> Iterator[Arrived]:
    """Wait, and let the caller do its work a few times per second."""
    end_s = time.monotonic() + seconds
    while (left_s := end_s - time.monotonic()) > 0:
        time.sleep(min(left_s, 0.1))
        yield time.time_ns(), []
