"""Pass messages and poses to observers, such as the recorder and the history."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dropanchor_service.estimation.columns import Array


def _ignore(*_: object) -> None:
    pass


@dataclass(frozen=True)
class Observers:
    """Functions that the ingest thread calls. They must return at once.

    messages: receives the admitted messages of a turn: row, payload, encoding, arrival (UTC, ns). poses: receives POSE
    from the engine, per row in order of time, after the messages of the same turn.
    """

    messages: Callable[[Sequence[tuple[int, bytes, str, int]]], None] = _ignore
    poses: Callable[[Array], None] = _ignore


NO_OBSERVERS = Observers()
