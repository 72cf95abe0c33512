"""What a destination holds and nobody reads again: the secret of a webhook, and its URL after the host.

The path or the query of many receivers is their password, and nothing tells such a path from another one.
"""

from urllib.parse import urlsplit

from dropanchor_schemas.destinations import Destination, WebhookDestination
from dropanchor_schemas.sentences import say

NOT_SHOWN = "…"


class NotShownError(ValueError):
    """A URL has the mark of what is not shown. The message says what to do."""


def shown(destination: Destination) -> Destination:
    """Return the destination as answers have it."""
    if not isinstance(destination, WebhookDestination):
        return destination
    return destination.model_copy(update={"secret": None, "url": shown_url(destination.url)})


def shown_url(url: str) -> str:
    """Return the URL as answers have it, `https://host/…`; one that ends with its host as it is."""
    parts = urlsplit(url)
    user, _, host = parts.netloc.rpartition("@")
    hides = user or parts.path.strip("/") or parts.query or parts.fragment
    return f"{parts.scheme}://{host}/{NOT_SHOWN}" if hides else url


def completed(destination: Destination, present: Destination | None) -> Destination:
    """Return the destination with what it leaves as it is: a secret that is None, and a URL as answers have it.

    Raises NotShownError when there is no such URL.
    """
    if not isinstance(destination, WebhookDestination):
        return destination
    if isinstance(present, WebhookDestination):
        url = present.url if destination.url == shown_url(present.url) else destination.url
        destination = destination.model_copy(update={"secret": destination.secret or present.secret, "url": url})
    if NOT_SHOWN in destination.url:
        raise NotShownError(
            say("url_hidden", "{mark} in the URL stands for what is not shown: give the whole URL", mark=NOT_SHOWN)
        )
    return destination
