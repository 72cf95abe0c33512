"""Formats other than JSON."""
