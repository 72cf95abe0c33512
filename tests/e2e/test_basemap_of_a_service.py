"""A running service shows the base map that its settings name."""

from pathlib import Path

from support.basemap_files import basemap_file, image_tile
from support.service import running_service, settings_file


def test_a_service_serves_the_tiles_of_its_file(tmp_path: Path) -> None:
    tile = image_tile((10, 20, 30))
    path = basemap_file(tmp_path / "yard.pmtiles", {(1, 1, 0): tile})
    settings = settings_file(tmp_path, [], "")
    settings.write_text(f'{settings.read_text()}\n[basemap]\ntiles = "{path}"\nattribution = "Land survey"\n')
    with running_service("--config", str(settings)) as service:
        assert service.get("/api/v1/basemap")["tiles"]["attribution"] == [{"text": "Land survey", "link": None}]
        assert service.ask("GET", "/api/v1/basemap/1/1/0").content == tile
        assert service.ask("GET", "/api/v1/basemap/1/0/0").status_code == 204
        assert service.stop() == 0
