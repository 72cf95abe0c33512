"""Ids of omlox objects. Each follows from an id of this service, so that nothing has to be stored."""

from uuid import UUID, uuid5

_NAMESPACE = UUID("6f2f9d3e-5d0c-4b58-9a57-0d1a3c8c6a10")


def trackable_id(site: str, tag: str) -> UUID:
    """Return the id of the trackable that stands for a tag."""
    return uuid5(_NAMESPACE, f"{site}\n tag\n{tag}")


def zone_id(site: str, anchor: str) -> UUID:
    """Return the id of the zone around an anchor."""
    return uuid5(_NAMESPACE, f"{site}\n anchor\n{anchor}")


def fence_id(site: str, zone: str) -> UUID:
    """Return the id of the fence that stands for a zone of this service; a zone whose id is a UUID keeps it."""
    try:
        own = UUID(zone)
    except ValueError:
        return uuid5(_NAMESPACE, f"{site}\n zone\n{zone}")
    return own if str(own) == zone else uuid5(_NAMESPACE, f"{site}\n zone\n{zone}")
