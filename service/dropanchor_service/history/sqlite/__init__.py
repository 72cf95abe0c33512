"""Tracks in a SQLite file, which belongs to one site and one process."""
