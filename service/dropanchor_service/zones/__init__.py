"""Zones and rules: which tags are where, by probability."""
