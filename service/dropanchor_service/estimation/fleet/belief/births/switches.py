"""Whether a birth is switched on: a bit of the tuning, so that an engine can run without it."""

from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.fleet.tuning import Tuning


@njit(nogil=True)
def is_on(kind: int, t: Tuning) -> bool:
    """Return whether a birth, by its number, is switched on."""
    return bool((t.births >> kind) & 1 == 1)
