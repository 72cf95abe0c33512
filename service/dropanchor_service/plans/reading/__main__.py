"""Read a file from the standard input. Write a line with its `Description`, and then the image.

The only argument is a `Request` as JSON.
"""

import sys

from dropanchor_schemas.pose import Phrase
from dropanchor_schemas.sentences import said_by
from dropanchor_service.plans.reading.messages import Description, ReadPlan, Request
from dropanchor_service.plans.reading.read_plan import read_plan
from dropanchor_service.plans.reading.refused import RefusedError
from dropanchor_service.runtime.helper_process import limit

MEMORY_BYTES = 3 * 2**30


def main() -> None:
    limit(MEMORY_BYTES)
    request = Request.model_validate_json(sys.argv[1])
    try:
        read = read_plan(sys.stdin.buffer.read(), request)
    except RefusedError as error:
        read = ReadPlan(Description(problem=said_by(error), problem_phrase=Phrase.of(said_by(error))), b"")
    sys.stdout.buffer.write(read.description.model_dump_json().encode() + b"\n" + read.content)
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
