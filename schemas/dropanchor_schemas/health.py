"""The health of a tag on the wire: its limits, and how to write it. This module needs only the standard library.

A tag reports its health seldom, in JSON, beside its samples. `tag_health.py` defines and decodes the message.
"""

import json
from typing import Any, NamedTuple

from dropanchor_schemas.wire import VERSION

MAX_HEALTH_BYTES = 1_024
MAX_FIRMWARE_LENGTH = 64


class Limits(NamedTuple):
    """The least and the greatest value that a tag can have measured."""

    low: float
    high: float


LIMITS: dict[str, Limits] = {
    "battery_fraction": Limits(0.0, 1.0),
    "battery_v": Limits(0.0, 1_000.0),
    "temperature_c": Limits(-100.0, 200.0),
    "rssi_dbm": Limits(-200.0, 50.0),
    "spool_bytes": Limits(0, 2**53),
    "spool_oldest_s": Limits(0.0, 1e9),
    "lost_messages": Limits(0, 2**53),
}


def is_absurd(name: str, value: Any) -> bool:
    """Return whether no tag can have measured this value. NaN is absurd."""
    if name == "firmware":
        return not str(value).isprintable()
    limits = LIMITS.get(name)
    return limits is not None and not limits.low <= value <= limits.high


def encode_health(values: dict[str, Any]) -> bytes:
    """Return the JSON payload of these values. Raises ValueError for values that JSON cannot hold, such as NaN."""
    return json.dumps({"version": VERSION} | values, separators=(",", ":"), allow_nan=False).encode()
