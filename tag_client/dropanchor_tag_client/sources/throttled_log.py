"""Log each text at most once per second."""

import logging
import time
from collections.abc import Callable

_log = logging.getLogger(__name__)
_INTERVAL_S = 1.0


def throttled_log() -> Callable[[str], None]:
    """Return a function that logs a text, unless it logged the same one within the last second."""
    logged_s: dict[str, float] = {}

    def log(text: str) -> None:
        nonlocal logged_s
        now_s = time.monotonic()
        logged_s = {known: at_s for known, at_s in logged_s.items() if now_s - at_s < _INTERVAL_S}
        if text not in logged_s:
            logged_s[text] = now_s
            _log.info("%s", text)

    return log
