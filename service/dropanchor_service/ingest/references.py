"""The barometer that shows the weather of each site: that of the tag whose height is told to be a `reference`."""

from collections.abc import Iterable

from dropanchor_schemas.site import TagSettings
from dropanchor_service.estimation.protocols import Engine, FollowsPressure

NONE = -1


class PressureReferences:
    """Tells the engine which row shows the weather. Of several references of a site the one configured last counts."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._rows: dict[int, int] = {}  # by site

    def resume(self, site: int, row: int, tag: TagSettings) -> None:
        """Note a row that the engine knows from a checkpoint."""
        if tag.height_motion == "reference":
            self._rows[site] = row

    def follow(self, site: int, row: int, tag: TagSettings, known: Iterable[int]) -> None:
        """Let the pressures of a row that was configured count from the reference, or those of `known` from its own.

        known: the other rows of its site.
        """
        if not isinstance(self._engine, FollowsPressure):
            return
        if tag.height_motion == "reference":
            self._rows[site] = row
            for other in known:
                self._engine.refer(other, row)
            return
        if self._rows.get(site) == row:
            del self._rows[site]
        self._engine.refer(row, self._rows.get(site, NONE))
