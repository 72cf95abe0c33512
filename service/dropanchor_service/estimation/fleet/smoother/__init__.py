"""Smoothed tracks: what later samples say about earlier poses."""
