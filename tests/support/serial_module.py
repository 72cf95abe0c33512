"""A UWB module at the other end of a real pseudo-terminal, which can be unplugged."""

import os
import select
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_SPEEDS = {115_200: termios.B115200, 921_600: termios.B921600}

Answer = Callable[[bytes], bytes]
"""Return what the module prints after it received these bytes. Called every `period_s` without bytes, too."""


class SerialModule:
    """A module. path: of its port while it is plugged in. written: all bytes that were written to the module."""

    def __init__(self, path: Path, answer: Answer, baud: int, period_s: float) -> None:
        self.path = path
        self.written = b""
        self._answer, self._baud, self._period_s = answer, baud, period_s
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()

    def plug(self, answer: Answer | None = None) -> None:
        self._answer = answer or self._answer
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path.symlink_to(os.ttyname(self._slave))
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        if self._thread is None:
            return
        self._stop.set()
        self._thread.join()
        self._thread = None
        self.path.unlink()
        os.close(self._master)
        os.close(self._slave)

    def _run(self) -> None:
        while not self._stop.is_set():
            if select.select([self._master], [], [], self._period_s)[0]:
                self._print(self._answer(self._read()))
            else:
                self._print(self._answer(b""))

    def _read(self) -> bytes:
        data = os.read(self._master, 4096)
        self.written += data
        return data

    def _print(self, data: bytes) -> None:
        """Send the bytes as fast as the wire allows. They are readable only at the baud rate of the module."""
        if termios.tcgetattr(self._master)[5] != _SPEEDS[self._baud]:
            data = bytes(byte ^ 0xA5 for byte in data)
        with suppress(BlockingIOError):  # nobody reads
            os.write(self._master, data)
        time.sleep(10 * len(data) / self._baud)


@contextmanager
def plugged_in(path: Path, answer: Answer, baud: int = 115_200, period_s: float = 0.05) -> Iterator[SerialModule]:
    module = SerialModule(path, answer, baud, period_s)
    module.plug()
    try:
        yield module
    finally:
        module.unplug()


def talkative(*texts: str | bytes) -> Answer:
    """Return a module that prints one text after the other by itself, and ignores what it receives."""
    turn = 0

    def answer(sent: bytes) -> bytes:
        nonlocal turn
        if sent:
            return b""
        turn += 1
        text = texts[turn % len(texts)]
        return text if isinstance(text, bytes) else f"{text}\r\n".encode()

    return answer


def started_by(command: bytes, text: str, *, echo: str = "OK") -> Answer:
    """Return a module that starts and stops to print with this command. It answers other lines with an error."""
    reports, received = False, b""

    def answer(sent: bytes) -> bytes:
        nonlocal reports, received
        received += sent
        if command in received:
            reports, received = not reports, b""
            return f"{echo}\r\n".encode()
        if received.endswith(b"\r"):
            received = b""
            return b"ERROR\r\n"
        return f"{text}\r\n".encode() if reports and not sent else b""

    return answer


def dwm1001_shell(text: str) -> Answer:
    """Return a DWM1001: binary at first, then a shell after two carriage returns. `lec` starts and stops reports."""
    shell, reports, received = False, False, b""

    def answer(sent: bytes) -> bytes:
        nonlocal shell, reports, received
        received += sent
        if not shell and received.endswith(b"\r\r"):
            shell, received = True, b""
            return b"\r\n\r\n DWM1001 TWR Real Time Location System\r\n\r\ndwm> "
        if shell and received.endswith(b"lec\r"):
            reports, received = not reports, b""
            return b"lec\r\ndwm> "
        if sent and not shell:
            return b"@\x01\x01" if received.endswith(b"lec\r") else b""
        return f"{text}\r\n".encode() if reports and not sent else b""

    return answer
