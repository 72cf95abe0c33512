"""Wait for the database, but not for ever.

A server that is frozen, or a pooler that has none, keeps its connections open and acknowledges what the kernel
receives: neither the statement timeout of the server nor a keepalive ends the wait.
"""

import time
from collections.abc import Callable, Generator
from threading import Event
from typing import Any, TypeVar

import psycopg

T = TypeVar("T")
_Waiting = Generator[Any, Any, T]


class PatientConnection(psycopg.Connection[Any]):
    """A connection that is closed when the server says nothing for `silence_s`, or once `give_up` is set."""

    silence_s = 65.0
    give_up: Event | None = None

    def wait(self, gen: _Waiting[T], *arguments: Any, **options: Any) -> T:
        return super().wait(_until(gen, self._require_news), *arguments, **options)

    def _require_news(self, silent_s: float) -> None:
        """Raise OperationalError, and close the connection, if there is no point in waiting longer."""
        stops = self.give_up is not None and self.give_up.is_set()
        if stops or silent_s > self.silence_s:
            self.pgconn.finish()  # in the middle of an answer, so nothing else can be asked
            raise psycopg.OperationalError(
                "the service stops" if stops else f"it has said nothing for {self.silence_s:.0f} s"
            )


def _until(gen: _Waiting[T], require_news: Callable[[float], None]) -> _Waiting[T]:
    """Pass on what psycopg says of the socket, and how long there has been no news, s."""
    since_s = time.monotonic()
    try:
        state = next(gen)
        while True:
            news = yield state
            since_s = time.monotonic() if news else since_s
            require_news(time.monotonic() - since_s)
            state = gen.send(news)
    except StopIteration as end:
        value: T = end.value
        return value
