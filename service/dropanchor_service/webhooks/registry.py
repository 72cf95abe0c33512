"""The webhooks: which of them an event goes to, and what may be saved."""

from collections.abc import Sequence
from pathlib import Path

from dropanchor_schemas.webhooks import Webhook
from dropanchor_service.events.drafts import Draft
from dropanchor_service.store.items import PRIVATE, NamedItems, adapter_of

MAX_WEBHOOKS = 20
FILE_NAME = "webhooks.json"


def open_webhooks(folder: Path | None) -> NamedItems[Webhook]:
    """Load the file, which only the service's user may read: it holds the secrets.

    Raises OSError or pydantic's ValidationError.
    """
    path = None if folder is None else folder / FILE_NAME
    return NamedItems(adapter_of(Webhook), path, MAX_WEBHOOKS, PRIVATE)


def addressees(webhooks: NamedItems[Webhook], draft: Draft) -> Sequence[str]:
    """Return the ids of the webhooks that want the event."""
    return [webhook.id for webhook in webhooks.all.values() if _wants(webhook, draft)]


def _wants(webhook: Webhook, draft: Draft) -> bool:
    return (
        webhook.enabled
        and (not webhook.types or draft.type in webhook.types)
        and (not webhook.zones or draft.zone in webhook.zones)
        and (not webhook.tags or draft.tag in webhook.tags or draft.data.get("other_tag") in webhook.tags)
    )
