"""Find out which module is on a port. Write to the port only if nothing arrives."""

import time
from collections.abc import Callable, Generator

import serial

from dropanchor_tag_client.sources.modules.catalogue import MODULES, Module
from dropanchor_tag_client.sources.modules.report import Report

Arrived = tuple[int, list[Report]]
_LISTEN_S = 1.5
_BETWEEN_WRITES_S = 1.0
_CHUNK = 4096


def detect(port: serial.Serial, baud: int | None, log: Callable[[str], None]) -> Generator[Arrived, None, Module]:
    """Return the module whose report is understood first. Tries the usual baud rates in turn, for ever.

    log: takes a message for the user.
    """
    rates = [baud] if baud else sorted({module.baud for module in MODULES.values()})
    while True:
        counts = dict.fromkeys(rates, 0)
        for rate in rates:
            port.baudrate = rate
            found, counts[rate] = yield from _listen(port)
            silent = () if counts[rate] else (module for module in MODULES.values() if module.baud == rate)
            for candidate in silent:  # a module that sends something else is left alone
                if found is None and candidate.start_commands:
                    yield from write(port, candidate.start_commands)
                    found, _ = yield from _listen(port)
            if found is not None:
                return found
        log(f"{port.port}: no module recognised yet ({_counts_text(counts)}). --module says which it is.")


def read(port: serial.Serial) -> bytes:
    """Return the bytes that have arrived, or none after a short while."""
    return bytes(port.read(max(1, min(port.in_waiting, _CHUNK))))


def write(port: serial.Serial, commands: tuple[bytes, ...]) -> Generator[Arrived, None, None]:
    """Write the commands, with a pause between them. What arrives in a pause is thrown away."""
    for index, command in enumerate(commands):
        end_s = time.monotonic() + (_BETWEEN_WRITES_S if index else 0.0)
        while time.monotonic() < end_s:
            read(port)
            yield time.time_ns(), []
        port.write(command)


def _listen(port: serial.Serial) -> Generator[Arrived, None, tuple[Module | None, int]]:
    """Return the module whose report is understood within a while, and how many bytes were received."""
    parsers = [(module, module.parser()) for module in MODULES.values()]
    end_s, received = time.monotonic() + _LISTEN_S, 0
    while time.monotonic() < end_s:
        data = read(port)
        received += len(data)
        for module, parser in parsers:
            if parser.feed(data):
                return module, received
        yield time.time_ns(), []
    return None, received


def _counts_text(counts: dict[int, int]) -> str:
    return ", ".join(f"{count} bytes at {rate} baud" for rate, count in counts.items())
