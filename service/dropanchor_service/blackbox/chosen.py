"""Find the pieces of a black box from which a moment can be run again, and read what is in them."""

from collections.abc import Iterator, Set
from pathlib import Path

from dropanchor_schemas.sentences import say
from dropanchor_service.answers.times import iso_utc
from dropanchor_service.blackbox.block import Block
from dropanchor_service.blackbox.pieces import TURNS, Piece, pieces_in
from dropanchor_service.checkpoints.format import CheckpointError
from dropanchor_service.recording.reading import Turn

LEAD_NS = 60_000_000_000  # of a run before what is asked: the plots of an explanation show a minute


class BoxError(Exception):
    """The black box cannot tell; the message says why."""


def chosen(folder: Path, from_ns: int, to_ns: int, lead_ns: int = LEAD_NS) -> list[Piece]:
    """Return the piece to begin with, and those that go on from it until `to_ns`. Raises BoxError.

    The run begins `lead_ns` before `from_ns`, if the process ran that long.
    """
    every = pieces_in(folder)
    before = [piece for piece in every if piece.from_ns <= from_ns]
    if not before:
        raise BoxError(_nothing(every))
    session = [piece for piece in every if piece.session == before[-1].session and piece.from_ns <= to_ns]
    early = [number for number, piece in enumerate(session) if piece.from_ns <= from_ns - lead_ns]
    return session[early[-1] if early else 0 :]


def _nothing(every: list[Piece]) -> str:
    if not every:
        return say("box_empty", "The black box holds nothing yet.")
    begin = iso_utc(every[0].from_ns)
    return say("box_from", "The black box holds nothing of that time: it begins at {from_utc}.", from_utc=begin)


def turns_of(pieces: list[Piece], site: str, tags: Set[str] | None, from_ns: int, to_ns: int) -> Iterator[Turn]:
    """Yield the turns of these pieces in order. tags: None for all. A block that is damaged ends its piece."""
    for piece in pieces:
        try:
            for _, content in piece.records(TURNS, from_ns=from_ns, to_ns=to_ns):
                for turn in Block(content).turns(site, tags):
                    if from_ns <= turn.t_ns <= to_ns:
                        yield turn
        except (OSError, CheckpointError):  # pruned meanwhile, or damaged: what follows must not be run without it
            return
