"""Which heights only count from where a tag starts, because nobody told the height there."""

import numpy as np

from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.columns import Array, HeightSource
from dropanchor_service.store.records import enlarged


class ToldHeights:
    """Whether the height at which each row started is known. Engines count from 0 m where it is not."""

    def __init__(self) -> None:
        self._untold = np.zeros(0, bool)  # by row
        self._elsewhere = np.zeros(0, bool)  # by row: it began again where it may have climbed to

    def tell(self, row: int, tag: TagSettings) -> None:
        """Note what the settings of a row say."""
        self._reserve(row)
        self._untold[row] = not tag.tells_height

    def begin(self, row: int, at_start: bool) -> None:
        """Note that a row begins, at the start of its settings or wherever its tag is now."""
        self._reserve(row)
        self._elsewhere[row] = not at_start

    def mark(self, poses: Array) -> None:
        """Set `z_source` of the POSE whose height is not that in the site's frame, in place."""
        rows, source = poses["row"], poses["z_source"]
        climbed = self._elsewhere[rows] & (source == HeightSource.PRESSURE)
        source[self._untold[rows] | climbed] = HeightSource.START

    def _reserve(self, row: int) -> None:
        if row >= len(self._untold):
            count = max(row + 1, 2 * len(self._untold))
            self._untold, self._elsewhere = enlarged(self._untold, count), enlarged(self._elsewhere, count)
