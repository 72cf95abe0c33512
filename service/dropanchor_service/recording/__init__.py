"""Recordings: raw samples and poses in MCAP files, which Foxglove and Lichtblick open and `dropanchor replay` reads."""
