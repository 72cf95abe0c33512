"""Runs an engine on a recording, after the fact, and tells how far its poses are from the truth."""
