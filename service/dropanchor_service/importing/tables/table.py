"""What a table of readings offers, and its cells."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from dropanchor_service.importing.readings import LeftOut

Row = tuple[int, Sequence[Any]]
"""Number of the line or message, and one value for each column; None or an empty text where there is none."""

_EMPTY = {"", "nan", "null", "none", "na", "n/a", "-", "--", "inf", "-inf", "+inf"}


class Table(Protocol):
    """name: of its file or topic. columns: their names. notes: what was decided to read it."""

    @property
    def name(self) -> str: ...

    @property
    def columns(self) -> Sequence[str]: ...

    @property
    def notes(self) -> Sequence[str]: ...

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
        found = float(value)
    return found if math.isfinite(found) else None


def exact_number(value: Any) -> int | float | None:
    """Return a cell as a number, a whole one as int: times in ns do not fit into a float. Raises ValueError."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    if isinstance(value, str) and value.strip().isdigit():
        return int(value)
    return number(value)


def text_of(value: Any) -> str:
    """Return a cell as the text of an id: 7 for 7.0."""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    text = str(value).strip() if value is not None else ""
    whole, point, rest = text.partition(".")
    return whole if point and whole.isdigit() and not rest.strip("0") else text
