"""Webhooks: events delivered over HTTP."""
