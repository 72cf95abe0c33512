"""A channel is emptied in batches, and nobody waits for the first entry while many come."""

from collections import deque

import zenoh

from dropanchor_service.zenoh_io.channel import MANY, drain


class Channel:
    """Gives these batches: the next one has come whenever somebody waits or gathers."""

    def __init__(self, *batches: range) -> None:
        self._coming = deque(batches)
        self._entries: deque[int] = deque()
        self.calls: list[str] = []

    def come(self) -> None:
        if self._coming:
            self._entries.extend(self._coming.popleft())

    def recv(self) -> int:
        self.calls.append("recv")
        if not self._entries:
            self.come()
        return self._next()

    def try_recv(self) -> int | None:
        return self._next() if self._entries or not self._coming else None

    def gather(self, has_first: bool) -> None:
        self.calls.append("more" if has_first else "first")
        if not has_first:
            self.come()

    def _next(self) -> int:
        if not self._entries:
            raise zenoh.ZError("closed")
        return self._entries.popleft()


def test_while_many_entries_come_nobody_waits_for_the_first_one() -> None:
    channel = Channel(range(MANY + 1), range(MANY), range(1), range(2))
    assert list(drain(channel, channel.gather)) == [*range(MANY + 1), *range(MANY), *range(1), *range(2)]
    assert channel.calls[:5] == ["recv", "more", "first", "first", "recv"]


def test_an_empty_batch_is_followed_by_a_wait() -> None:
    channel = Channel(range(MANY + 1), range(0), range(1))
    assert list(drain(channel, channel.gather)) == [*range(MANY + 1), 0]
    assert channel.calls == ["recv", "more", "first", "recv", "more"]
