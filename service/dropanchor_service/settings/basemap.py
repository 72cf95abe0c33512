"""The settings of the base map."""

from pathlib import Path

from pydantic import Field

from dropanchor_schemas.models import Exact


class BasemapSettings(Exact):
    """A map behind a site with latitude and longitude. It needs no internet access."""

    tiles: Path | None = Field(
        default=None,
        description="PMTiles file (version 3) with PNG, JPEG, WebP, AVIF or vector tiles. Not set: there is no base "
        "map. A changed file needs a restart.",
    )
    attribution: str | None = Field(
        default=None,
        description="Who made the map, as text or HTML with links, if the file does not say it or says it wrong.",
    )
