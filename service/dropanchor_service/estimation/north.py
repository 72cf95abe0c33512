"""What an engine tells about where north is."""

from typing import Protocol, runtime_checkable

import numpy as np

from dropanchor_service.estimation.columns import Array

NORTH = np.dtype(
    [
        ("row", "i4"),
        ("declination", "f8"),  # rad, that makes north of the magnetometer that of the site, as the settings tell it
        ("std", "f8"),  # rad
    ]
)


@runtime_checkable
class LearnsNorth(Protocol):
    """An engine whose tracks may tell where north is."""

    def norths(self, rows: Array) -> Array:
        """Return NORTH of those of the rows whose tracks tell it."""

    def turn_north(self, row: int, declination: float) -> bool:
        """Use another declination, rad, in `row` if its own start tells it north. Return whether it does."""
