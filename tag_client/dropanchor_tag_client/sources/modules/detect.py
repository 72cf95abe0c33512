"""Find out which module is on a port. Write to the port only if nothing arrives."""

import time
from collections.abc import Callable, Generator

import serial

from dropanchor_tag_client.sources.modules.catalogue import MODULES
from dropanchor_tag_client.sources.modules.heard import Heard
from dropanchor_tag_client.sources.modules.module import Module
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
        heard = {rate: Heard() for rate in rates}
        for rate in rates:
            port.baudrate = rate
            found = yield from _listen(port, heard[rate])
            silent = () if heard[rate].count else (module for module in MODULES.values() if module.baud == rate)
            for candidate in silent:  # a module that sends something else is left alone
                if found is None and candidate.start_commands:
                    yield from write(port, candidate.start_commands)
                    found = yield from _listen(port, heard[rate])
            if found is not None:
                return found
        log(f"{port.port}: no module recognised yet {_what_arrived(heard)}")


def recognised(data: bytes) -> Module | None:
    """Return the module that understands some of what arrived, if there is one."""
    return next((module for module in MODULES.values() if module.parser().feed(data)), None)


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


def _listen(port: serial.Serial, heard: Heard) -> Generator[Arrived, None, Module | None]:
    """Return the module whose report is understood within a while."""
    parsers = [(module, module.parser()) for module in MODULES.values()]
    end_s = time.monotonic() + _LISTEN_S
    while time.monotonic() < end_s:
        data = read(port)
        heard.add(data)
        for module, parser in parsers:
            if parser.feed(data):
                return module
        yield time.time_ns(), []
    return None


def _what_arrived(heard: dict[int, Heard]) -> str:
    counts = ", ".join(f"{one.count} bytes at {rate} baud" for rate, one in heard.items())
    rate, most = max(heard.items(), key=lambda item: (item[1].is_text, item[1].count))
    if not most.count:
        return f"({counts}). Is it on? --module says which it is."
    return f"({counts}). The last that arrived: {most.sentence(rate)}"
