"""The base map as the interface shows it: what the page has to know, and the tiles."""

import logging
from pathlib import Path

from dropanchor_schemas.basemap import Basemap, BasemapTiles
from dropanchor_service.basemap.attribution import credits_in
from dropanchor_service.basemap.file import TileFile

_log = logging.getLogger(__name__)


class ServedBasemap:
    """The tiles of a file, and their description."""

    def __init__(self, path: Path, attribution: str | None) -> None:
        """attribution: instead of that in the file. Raises OSError and UnusableFileError."""
        self.file = TileFile(path)
        written = self.file.metadata.get("attribution")
        found = credits_in(written if attribution is None and isinstance(written, str) else attribution or "")
        west, south, east, north = self.file.bounds
        self.description = Basemap(
            tiles=BasemapTiles(
                version=self.file.version,
                media_type=self.file.media_type,
                min_zoom=self.file.min_zoom,
                max_zoom=self.file.max_zoom,
                west=west,
                south=south,
                east=east,
                north=north,
                attribution=found,
            )
        )
        if attribution is None and not found:
            _log.warning(
                "basemap.tiles: %s does not say who made the map. Most licences demand it: set basemap.attribution",
                path,
            )
