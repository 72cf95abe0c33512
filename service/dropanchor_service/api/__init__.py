"""The REST interface, the stream and the page: reads the store, changes the site; knows no engine and no Zenoh."""

from dropanchor_service.api.app import create_app

__all__ = ["create_app"]
