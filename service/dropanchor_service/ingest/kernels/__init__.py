"""Compiled loops over the messages of a turn."""
