"""The base map: tiles of a PMTiles file, shown behind a site with latitude and longitude."""
