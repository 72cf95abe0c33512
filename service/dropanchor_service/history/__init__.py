"""Tracks of the past, on disk."""
