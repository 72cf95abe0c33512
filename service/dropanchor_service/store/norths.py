"""Where north is, as the track of each tag tells it."""

from typing import NamedTuple


class North(NamedTuple):
    """declination_rad: that makes magnetic north that of the site, as `Site.declination_rad`. std_rad: how sure."""

    declination_rad: float
    std_rad: float


class Norths:
    """What tracks tell, by row of a tag. The ingest thread writes, whoever deletes a tag forgets; any thread reads."""

    def __init__(self) -> None:
        self._of_rows: dict[int, North] = {}

    def of(self, row: int) -> North | None:
        """Return what the track of a tag tells, None if it tells nothing."""
        return self._of_rows.get(row)

    def set(self, row: int, north: North | None) -> None:
        """Replace what is known from a row."""
        if north is None:
            self._of_rows.pop(row, None)
        else:
            self._of_rows[row] = north

    def all(self) -> list[tuple[int, North]]:
        """Return each row whose track tells something, with what it tells."""
        return list(self._of_rows.copy().items())
