"""Tracks in a PostgreSQL database, which several sites and services may share."""
