"""Who else is told of what comes in and what comes out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dropanchor_service.estimation.columns import Array


def _nobody(*_: object) -> None:
    pass


@dataclass(frozen=True)
class Observers:
    """Called by the ingest thread, which cannot wait for them.

    messages: with the admitted messages of a turn: row, payload, encoding, arrival. poses: with POSE as the engine
    gave them, per row in order of time, after `messages` of the same turn.
    """

    messages: Callable[[Sequence[tuple[int, bytes, str, int]]], None] = _nobody
    poses: Callable[[Array], None] = _nobody


NO_OBSERVERS = Observers()
