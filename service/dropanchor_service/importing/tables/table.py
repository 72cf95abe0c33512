"""What a table of readings offers, and its cells."""

import math
from collections.abc import Iterator, Sequence
from decimal import Decimal
from typing import Any, ClassVar, Protocol

from dropanchor_service.importing.readings import LeftOut

Row = tuple[int, Sequence[Any]]
"""Number of the line or message, and one value for each column; None or an empty text where there is none."""

RANGE_ADVICE = "--map range.ID=COLUMN names another one"

Exact = int | float | Decimal

_EMPTY = {"", "nan", "null", "none", "na", "n/a", "-", "--", "inf", "-inf", "+inf"}


class Table(Protocol):
    """name: of its file or topic. unit: what a row of it is. columns: their names. notes: what was decided to read it.
    anchor_advice: what to do where nothing names the anchor."""

    unit: ClassVar[str]

    @property
    def name(self) -> str: ...

    @property
    def columns(self) -> Sequence[str]: ...

    @property
    def notes(self) -> Sequence[str]: ...

    @property
    def anchor_advice(self) -> str: ...

    def rows(self, left_out: LeftOut) -> Iterator[Row]: ...


def number(value: Any) -> float | None:
    """Return a cell as a number, None for an empty one. A comma may stand for the point. Raises ValueError."""
    if isinstance(value, str):
        try:
            found = float(value)
        except ValueError:
            text = value.strip()
            if text.lower() in _EMPTY:
                return None
            found = float(text.replace(",", ".") if text.count(",") == 1 and "." not in text else text)
    elif value is None or isinstance(value, bool):
        return None
    else:
        found = float(value) if not isinstance(value, int) or value.bit_length() < 1000 else math.inf
    return found if math.isfinite(found) else None


def exact_number(value: Any) -> Exact | None:
    """Return a cell as a number with all its digits: a float has too few for UTC in ns. Raises ValueError."""
    found = number(value)
    if found is None or isinstance(value, int):
        return None if found is None else int(value)
    if isinstance(value, str):
        return int(value) if value.strip().isdigit() else Decimal(value.strip().replace(",", "."))
    return found


def text_of(value: Any) -> str:
    """Return a cell as the text of an id: 7 for 7.0."""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    text = str(value).strip() if value is not None else ""
    whole, point, rest = text.partition(".")
    return whole if point and whole.isdigit() and not rest.strip("0") else text
