"""The starts of the tags of one site that ranges may still deny, and on which of them events hang."""

from collections.abc import Mapping

from dropanchor_schemas.events import RetractionReason
from dropanchor_service.events.drafts import StartBegan, StateValue
from dropanchor_service.store.starts import StartNews, StartPhase


class OpenStarts:
    """By tag. A start is stored once something hangs on it: most confirm what is known, and make no event."""

    def __init__(self, stored: Mapping[str, StartBegan]) -> None:
        self._open = dict(stored)
        self._hanging = set(stored)

    def of(self, tag: str) -> StartBegan | None:
        return self._open.get(tag)

    def begin(self, tag: str, news: StartNews, inside: Mapping[str, StateValue]) -> None:
        """Note a new start. inside: the zones in which the tag is."""
        self._open[tag] = StartBegan(tag, news.place, news.before, 0, inside)

    def confirm(self, tag: str, seen_ns: int) -> None:
        """Note that the tag is judged from now on. seen_ns: time of its latest pose."""
        if tag in self._open and tag not in self._hanging:
            self._open[tag] = self._open[tag]._replace(since_ns=seen_ns)

    def hang(self, tag: str) -> StartBegan | None:
        """Return the start of a tag that makes an event, if it is not stored yet."""
        if tag not in self._open or tag in self._hanging:
            return None
        self._hanging.add(tag)
        return self._open[tag]

    def close(self, tag: str) -> StartBegan | None:
        """Forget a start. Return it if something hangs on it."""
        start = self._open.pop(tag, None)
        hangs = tag in self._hanging
        self._hanging.discard(tag)
        return start if hangs else None


def verdict_on(start: StartBegan, news: StartNews) -> RetractionReason | None:
    """Return why what hangs on a start is not true, None if nothing says so.

    An operator takes a start back by removing it or by restoring the one before. A start at a third place says that
    the tag is there now, and nothing about the earlier one.
    """
    if news.phase == StartPhase.DENIED:
        return RetractionReason.START_DENIED
    if news.phase == StartPhase.TOLD and news.place in ("", start.before):
        return RetractionReason.START_TAKEN_BACK
    return None
