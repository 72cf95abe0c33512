"""Find out which module is on a port. Write to the port only if nothing arrives for a while."""

import time
from collections.abc import Callable, Generator, Iterable

import serial

from dropanchor_tag_client.sources.modules.catalogue import MODULES
from dropanchor_tag_client.sources.modules.heard import Heard
from dropanchor_tag_client.sources.modules.module import Module
from dropanchor_tag_client.sources.modules.recognise import unasked, understands
from dropanchor_tag_client.sources.modules.report import Report

Arrived = tuple[int, list[Report]]
_LISTEN_S = 1.5
_QUIET_S = 4.0  # a board that prints a line every few seconds is not written to
_BETWEEN_WRITES_S = 1.0
_CHUNK = 4096


def detect(port: serial.Serial, baud: int | None, log: Callable[[str], None]) -> Generator[Arrived, None, Module]:
    """Return the module whose measurement is understood first. Tries the usual baud rates in turn, for ever.

    log: takes a message for the user.
    """
    rates = [baud] if baud else sorted({module.baud for module in MODULES.values()})
    last_s = time.monotonic()
    while True:
        heard = {rate: Heard() for rate in rates}
        for rate in rates:
            port.baudrate = rate
            found = yield from _listen(port, heard[rate], unasked())
            if heard[rate].count:  # another device may talk here: it is left alone
                last_s = time.monotonic()
            elif time.monotonic() - last_s > _QUIET_S:
                found = yield from _ask(port, rate, heard[rate])
            if found is not None:
                return found
        log(f"{port.port}: no module recognised yet {_what_arrived(heard)}")
        rates.reverse()  # or a line every few seconds may come at the wrong one for ever


def _ask(port: serial.Serial, rate: int, heard: Heard) -> Generator[Arrived, None, Module | None]:
    """Return the module that reports after its start commands. One that measures only when asked is asked twice."""
    for candidate in MODULES.values():
        if candidate.baud == rate and candidate.start_commands:
            yield from write(port, candidate.start_commands)
            found = yield from _listen(port, heard, MODULES.values())
            if found is not None and found.poll:
                yield from write(port, found.start_commands)
                found = yield from _listen(port, heard, [found])
            if found is not None:
                return found
    return None


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


def _listen(port: serial.Serial, heard: Heard, candidates: Iterable[Module]) -> Generator[Arrived, None, Module | None]:
    """Return the module whose measurement is understood within a while."""
    parsers = [(module, module.parser()) for module in candidates]
    end_s = time.monotonic() + _LISTEN_S
    while time.monotonic() < end_s:
        data = read(port)
        heard.add(data)
        for module, parser in parsers:
            if understands(parser, data):
                return module
        yield time.time_ns(), []
    return None


def _what_arrived(heard: dict[int, Heard]) -> str:
    counts = ", ".join(f"{one.count} bytes at {rate} baud" for rate, one in heard.items())
    rate, most = max(heard.items(), key=lambda item: item[1].clarity)
    if not most.count:
        return f"({counts}). Is it on? --module says which it is."
    return f"({counts}). The last that arrived: {most.sentence(rate)}"
