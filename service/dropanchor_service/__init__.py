"""Live positions of a fleet of tags around one dropped UWB anchor."""
