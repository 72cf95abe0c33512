"""Deliver events to destinations: webhooks, e-mail and MQTT."""
