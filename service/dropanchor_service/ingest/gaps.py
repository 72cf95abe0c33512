"""Remember which gaps in the numbers of publishers are worth asking the caches for. This module does no I/O."""

from collections.abc import Iterable
from dataclasses import dataclass

from dropanchor_service.ingest.kernels.sequences import PER_TAG
from dropanchor_service.ingest.publishers import SequenceState
from dropanchor_service.ingest.suspended import Number

PUBLISHERS_PER_TAG = 2 * PER_TAG  # remembered: those whose order is kept, and as many former ones


@dataclass
class _Publisher:
    """asked: its cache was asked for all messages before `asked.next`. has_cache: None while that is not known."""

    asked: SequenceState | None = None
    has_cache: bool | None = None


class Gaps:
    """What is known of the caches of each tag. The caller makes calls exclude each other."""

    def __init__(self) -> None:
        self._tags: dict[str, dict[int, _Publisher]] = {}

    def is_new(self, key: str, numbers: Iterable[Number]) -> bool:
        """Return whether a message is missing that no cache was asked for and that one may hold.

        numbers: of the messages of RUNNING publishers that are not in order.
        """
        new = [number for number in numbers if self._is_new(self._publisher(key, number.boot_id), number.sequence)]
        return bool(new)

    def on_cached(self, key: str, boot_id: int) -> None:
        """Note that the cache of this publisher answers."""
        self._publisher(key, boot_id).has_cache = True

    def on_alive(self, key: str) -> None:
        """Forget which publishers of this tag have no cache."""
        for publisher in self._tags.get(key, {}).values():
            publisher.has_cache = publisher.has_cache or None

    def on_no_answer(self, key: str, boot_id: int) -> None:
        """Note that the cache of this publisher did not answer. One that used to answer gets one more chance."""
        publisher = self._publisher(key, boot_id)
        publisher.has_cache = None if publisher.has_cache else False

    def has_cache(self, key: str, boot_id: int) -> bool:
        """Return whether the cache of this publisher has answered when it was last asked."""
        known = self._tags.get(key, {}).get(boot_id)
        return known is not None and known.has_cache is True

    def lacks_cache(self, key: str, boot_id: int) -> bool:
        """Return whether the cache of this publisher did not answer when it was last asked."""
        known = self._tags.get(key, {}).get(boot_id)
        return known is not None and known.has_cache is False

    def on_asked(self, key: str, newest: Number) -> None:
        """Note that the caches were asked for all messages before this one."""
        publisher = self._publisher(key, newest.boot_id)
        if publisher.asked is None or publisher.asked.ahead(newest.sequence) >= 0:
            publisher.asked = _until(newest.sequence)

    def _is_new(self, publisher: _Publisher, sequence: int) -> bool:
        """Return whether a gap that was not asked for lies before this message, which arrived after the others."""
        ahead = 1 if publisher.asked is None else publisher.asked.ahead(sequence)
        if ahead == 0:
            publisher.asked = _until(sequence)
        return ahead > 0 and publisher.has_cache is not False

    def _publisher(self, key: str, boot_id: int) -> _Publisher:
        """Return what is known of a publisher. Of too many, those are forgotten that were needed least recently."""
        of_tag = self._tags.setdefault(key, {})
        of_tag[boot_id] = publisher = of_tag.pop(boot_id, None) or _Publisher()
        if len(of_tag) > PUBLISHERS_PER_TAG:
            del of_tag[next(iter(of_tag))]
        return publisher


def _until(sequence: int) -> SequenceState:
    return SequenceState((sequence + 1) % 2**32, 0)
