"""The health of a tag before it is sent."""

import time
from collections import Counter
from typing import TYPE_CHECKING, Any, TypedDict

from dropanchor_schemas.health import MAX_FIRMWARE_LENGTH, is_absurd
from dropanchor_schemas.wire import Reason
from dropanchor_tag_client.remote import RemoteSettings

if TYPE_CHECKING:
    from dropanchor_tag_client.spooling import SpoolCounts


class HealthValues(TypedDict, total=False):
    """What a program may know about its tag. battery_fraction: 1 is full. firmware: as its maker writes the version."""

    battery_fraction: float
    battery_v: float
    temperature_c: float
    rssi_dbm: float
    firmware: str


def reportable(
    given: HealthValues, spool: "SpoolCounts | None", settings: RemoteSettings | None, refused: Counter[Reason]
) -> dict[str, Any]:
    """Return what a report contains: the given values that a tag can have measured, what its spool holds, and the
    settings of the service that are applied."""
    applied = {} if settings is None else {"settings": settings._asdict()}
    values: dict[str, Any] = {**given, **_of_spool(spool), **applied}
    if "firmware" in values:
        values["firmware"] = values["firmware"][:MAX_FIRMWARE_LENGTH]
    absurd = [name for name, value in values.items() if is_absurd(name, value)]
    if absurd:
        refused[Reason.HEALTH_ABSURD] += len(absurd)
    return {name: value for name, value in values.items() if name not in absurd}


def _of_spool(counts: "SpoolCounts | None") -> dict[str, Any]:
    if counts is None:
        return {}
    oldest_s = 0.0 if counts.oldest_ns is None else max(0.0, (time.time_ns() - counts.oldest_ns) * 1e-9)
    return {"spool_bytes": counts.waiting_bytes, "spool_oldest_s": oldest_s, "lost_messages": counts.dropped}
