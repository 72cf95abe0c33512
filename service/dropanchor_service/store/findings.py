"""What the check of the sensors has found about each tag."""

from collections.abc import Sequence

from dropanchor_service.estimation.plausibility.verdicts import Finding


class SensorFindings:
    """Findings by row of a tag. The ingest thread writes; any thread reads."""

    def __init__(self) -> None:
        self._of_rows: dict[int, Sequence[Finding]] = {}

    def of(self, row: int) -> Sequence[Finding]:
        """Return what is wrong with the sensors of a tag."""
        return self._of_rows.get(row, ())

    def set(self, row: int, found: Sequence[Finding]) -> None:
        """Replace what is known about a row."""
        if found:
            self._of_rows[row] = found
        else:
            self._of_rows.pop(row, None)
