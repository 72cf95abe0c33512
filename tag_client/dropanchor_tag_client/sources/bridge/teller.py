"""Tells a person what a broker does, at most once per second."""

import logging
import time
from collections.abc import Callable

_log = logging.getLogger(__name__)
_SAY_EVERY_S = 1.0


def say_seldom() -> Callable[[str], None]:
    """Return a function that logs a text, unless it logged the same one within the last second."""
    said: dict[str, float] = {}

    def say(text: str) -> None:
        now_s = time.monotonic()
        if now_s - said.get(text, -_SAY_EVERY_S) >= _SAY_EVERY_S:
            said.clear()
            said[text] = now_s
            _log.info("%s", text)

    return say
