"""Deliver events to destinations by webhook, e-mail and MQTT, and poses by MQTT."""
