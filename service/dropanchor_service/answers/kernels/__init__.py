"""Compiled loops behind the answers."""
