"""The settings of the base map: what cannot be one stops the start with a sentence that names the setting."""

from pathlib import Path

import pytest

from dropanchor_schemas.site import Georeference, Site
from dropanchor_service.basemap.errors import UnreadableTileError
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.persistence.site_folders import SiteFolders
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.store import Sites, SiteStore
from support.basemap_files import basemap_file, image_tile

BERLIN = Site(georeference=Georeference(lat=52.5, lon=13.4))


def opened(tiles: Path, site: Site = BERLIN) -> SiteFolders:
    settings = Settings.model_validate({"basemap": {"tiles": str(tiles)}})
    return SiteFolders(settings, Sites([(SiteStore(site, {}), settings.quota)]), lambda: 0, Metrics())


def test_a_file_that_is_missing_or_none_stops_the_start(tmp_path: Path) -> None:
    missing = tmp_path / "map.pmtiles"
    with pytest.raises(SettingsError) as refused:
        opened(missing)
    assert str(refused.value) == f"basemap.tiles: {missing} cannot be read: No such file or directory"
    with pytest.raises(SettingsError, match=r"basemap\.tiles: .* cannot be read: Is a directory"):
        opened(tmp_path)
    missing.write_bytes(b"SQLite format 3\0")
    with pytest.raises(SettingsError, match=r"basemap\.tiles: .* is not a PMTiles file of version 3"):
        opened(missing)


@pytest.mark.parametrize(("site", "warns"), [(BERLIN, False), (Site(), True)])
def test_a_site_without_latitude_and_longitude_is_warned_and_goes_on(
    tmp_path: Path, site: Site, warns: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with opened(basemap_file(tmp_path / "map.pmtiles", {(0, 0, 0): image_tile((1, 2, 3))}), site) as folders:
        assert folders.basemap is not None
        assert folders.basemap.file.tile(0, 0, 0) is not None
    assert ("the site has no latitude and longitude" in caplog.text) is warns
    with pytest.raises(UnreadableTileError):
        folders.basemap.file.tile(0, 0, 0)
