"""Publish events, poses and zones to the MQTT broker of the settings."""
