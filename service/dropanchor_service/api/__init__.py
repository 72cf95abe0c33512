"""The REST interface, the pose stream and the dashboard. They depend on the store, not on an engine or on Zenoh."""

from dropanchor_service.api.app import create_app

__all__ = ["create_app"]
