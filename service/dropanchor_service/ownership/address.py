"""Where API nodes reach a shard."""

import socket
from urllib.parse import urlsplit

from dropanchor_service.settings.http_url import http_url
from dropanchor_service.settings.model import Settings

_EVERYWHERE = ("0.0.0.0", "::")


def address_of(settings: Settings, url: str) -> str:
    """Return the address of a shard's REST interface. url: where it listens.

    The machine is that of `cluster.address`, or of `http.host`, or this one by its name if the shard listens on all
    addresses. A machine may have many shards, so each listens on a port of its own.
    """
    listens = urlsplit(url)
    named = urlsplit(settings.cluster.address or "").hostname
    host = named or (socket.gethostname() if settings.http.host in _EVERYWHERE else settings.http.host)
    assert listens.port is not None
    return http_url(host, listens.port, is_encrypted=listens.scheme == "https")
