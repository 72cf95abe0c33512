"""The table of births: where a hypothesis is born or changes in kind, and what for.

The documentation is written from it. The loop knows a birth by its number.
"""

from dropanchor_service.estimation.fleet.belief.births import numbers
from dropanchor_service.estimation.fleet.belief.births.rows_of_measurements import MEASUREMENTS
from dropanchor_service.estimation.fleet.belief.births.rows_of_motion import MOTION
from dropanchor_service.estimation.fleet.belief.births.rows_of_starts import STARTS

BIRTHS = tuple(sorted((*STARTS, *MOTION, *MEASUREMENTS), key=lambda birth: birth.number))


class NoBirthError(ValueError):
    """No birth has this name."""


def without(*names: str) -> int:
    """Return `Tuning.births` with these births switched off. Raises NoBirthError."""
    numbered = {birth.name: birth.number for birth in BIRTHS}
    switched_on = numbers.ALL
    for name in names:
        if name not in numbered:
            raise NoBirthError(f"no birth is named {name!r}; take one of {', '.join(numbered)}")
        switched_on &= ~(1 << numbered[name])
    return switched_on
