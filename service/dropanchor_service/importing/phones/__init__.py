"""Exports of apps that record the sensors of a phone."""
