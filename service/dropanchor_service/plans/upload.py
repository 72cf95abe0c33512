"""Have an uploaded file read by another process, one at a time, within limits of time and memory."""

from dropanchor_schemas.sentences import Sentence, say
from dropanchor_service.plans.reading.messages import Description, ReadPlan, Request
from dropanchor_service.plans.reading.refused import RefusedError
from dropanchor_service.runtime.helper_process import HelperProcess

TIMEOUT_S = 60.0
MAX_IMAGE_BYTES = 64 * 2**20

_TOO_HARD = say(
    "plan_too_hard",
    "the file is too large or too complicated to be read here, or damaged. Save it as PNG with fewer pixels",
)


class PlanReader:
    """Reads uploaded files for one event loop."""

    def __init__(self, timeout_s: float = TIMEOUT_S) -> None:
        self._process = HelperProcess("dropanchor_service.plans.reading", timeout_s, "reading an uploaded floor plan")

    async def read(self, content: bytes, request: Request) -> ReadPlan:
        """Return the image in a file. Raises RefusedError."""
        answer = await self._process.answer(content, request.model_dump_json())
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
