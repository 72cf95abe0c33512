"""Have an uploaded file read by another process, one at a time, within limits of time and memory."""

import asyncio
import logging
import sys
from contextlib import suppress

from dropanchor_schemas.sentences import Sentence, say
from dropanchor_service.plans.reading.messages import Description, ReadPlan, Request
from dropanchor_service.plans.reading.refused import RefusedError

TIMEOUT_S = 60.0
MAX_IMAGE_BYTES = 64 * 2**20

_TOO_HARD = say(
    "plan_too_hard",
    "the file is too large or too complicated to be read here, or damaged. Save it as PNG with fewer pixels",
)

_log = logging.getLogger(__name__)


class PlanReader:
    """Reads uploaded files for one event loop."""

    def __init__(self, timeout_s: float = TIMEOUT_S) -> None:
        self._timeout_s = timeout_s
        self._turn = asyncio.Semaphore()

    async def read(self, content: bytes, request: Request) -> ReadPlan:
        """Return the image in a file. Raises RefusedError."""
        async with self._turn:
            answer = await self._answer(content, request)
        if answer is None:
            raise RefusedError(_TOO_HARD)
        head, _, image = answer.partition(b"\n")
        if len(image) > MAX_IMAGE_BYTES:
            raise RefusedError(
                say(
                    "plan_bytes",
                    "the image needs {size} MiB. At most {most} are allowed",
                    size=len(image) >> 20,
                    most=MAX_IMAGE_BYTES >> 20,
                )
            )
        description = Description.model_validate_json(head)
        if description.problem:
            phrase = description.problem_phrase
            text = description.problem.removesuffix(".")
            raise RefusedError(text if phrase is None else Sentence(text, phrase.code, phrase.values))
        return ReadPlan(description, image)

    async def _answer(self, content: bytes, request: Request) -> bytes | None:
        """Return what the process wrote; None if it crashed or took too long."""
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "dropanchor_service.plans.reading", request.model_dump_json()),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            output, errors = await asyncio.wait_for(process.communicate(content), self._timeout_s)
        except TimeoutError:
            _log.warning("an uploaded floor plan could not be read within %g s", self._timeout_s)
            return None
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
        if process.returncode != 0:
            _log.warning("an uploaded floor plan could not be read: %s", errors.decode(errors="replace")[-1000:])
            return None
        return output
