"""Have one thing at a time done by another process, within a limit of time: it may crash or stall without harm."""

import asyncio
import logging
import os
import resource
import sys
from contextlib import suppress

CPU_S = 60
NICENESS = 10  # the estimators come first

_log = logging.getLogger(__name__)


class HelperProcess:
    """Runs a module for one event loop. waiting: how many wait for their turn now. what: what it does, for the log."""

    def __init__(self, module: str, timeout_s: float, what: str) -> None:
        self._module, self._timeout_s, self._what = module, timeout_s, what
        self._turn = asyncio.Semaphore()
        self.waiting = 0

    async def answer(self, content: bytes, *arguments: str) -> bytes | None:
        """Return what the process wrote; None if it crashed or took too long. content: its standard input."""
        self.waiting += 1
        try:
            async with self._turn:
                return await self._answer(content, arguments)
        finally:
            self.waiting -= 1

    async def _answer(self, content: bytes, arguments: tuple[str, ...]) -> bytes | None:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", self._module, *arguments),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            output, errors = await asyncio.wait_for(process.communicate(content), self._timeout_s)
        except TimeoutError:
            _log.warning("%s took more than %g s", self._what, self._timeout_s)
            return None
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
        if process.returncode != 0:
            _log.warning("%s failed: %s", self._what, errors.decode(errors="replace")[-1000:])
            return None
        return output


def limit(memory_bytes: int) -> None:
    """Limit what this process, which helps another one, takes from it."""
    os.nice(NICENESS)
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
