"""Answer one question in a process of its own: it is on the standard input, as JSON, and the answer on the output."""

import logging
import sys
from typing import Any

from dropanchor_schemas.pose import Phrase
from dropanchor_schemas.sentences import said_by
from dropanchor_service.answers.answers import to_json
from dropanchor_service.blackbox.chosen import BoxError
from dropanchor_service.blackbox.questions import Question, answer_to
from dropanchor_service.runtime.helper_process import limit

MEMORY_BYTES = 4 * 2**30


def main() -> None:
    limit(MEMORY_BYTES)
    logging.disable(logging.INFO)
    try:
        answer: dict[str, Any] = {"answer": answer_to(Question.model_validate_json(sys.stdin.buffer.read()))}
    except BoxError as error:
        phrase = Phrase.of(said_by(error))
        answer = {"problem": str(error), "phrase": None if phrase is None else phrase.model_dump()}
    sys.stdout.buffer.write(to_json(answer))
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
