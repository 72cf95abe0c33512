"""What the table says of one birth, and the moments of a node's step."""

from typing import NamedTuple

START, BEFORE, AFTER = "start", "before prediction", "after prediction"
BEFORE_RANGE, AFTER_RANGE, REDUCTION = "before a range", "after a range", "reduction"
CLASSES, END, FIRST = "class check", "end", "first of all"


class Birth(NamedTuple):
    """One birth. Births of one moment run together, in the order of the table.

    when: moment of the node's step. guard: what must hold. source, target: what the hypothesis is before and after.
    prior: log prior of the child, as in `Tuning` or a number. changes: what else differs from its source. period: how
    often it may happen. depth: log weight below the best at which a source is too light. needed_by: rows of `evaluate
    product`, replays or recordings that showed the need. decision: number of its record, 0 where none says why.
    """

    number: int
    name: str
    when: str
    guard: str
    source: str
    target: str
    prior: str
    changes: str
    period: str
    depth: str
    needed_by: str
    decision: int
