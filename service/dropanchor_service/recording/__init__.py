"""Recordings of raw samples and poses: MCAP files for Foxglove, Lichtblick and `dropanchor replay`."""
