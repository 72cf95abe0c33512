"""The part of `properties` that belongs to this service. The rest belongs to clients and is kept as it is."""

from collections.abc import Mapping
from typing import Any

from dropanchor_service.store.omlox_models import Properties

OWN = "dropanchor"


def with_own(properties: Properties | None, own: Mapping[str, Any]) -> Properties:
    """Return the properties of a client with those of this service."""
    return (properties or {}) | {OWN: dict(own)}


def without_own(properties: Properties | None) -> Properties | None:
    """Return the properties of a client, which may be sent back with those of this service."""
    return None if properties is None else {name: value for name, value in properties.items() if name != OWN}
