"""Messages of Decawave's gateway for the DWM1001 (PANS, MDEK1001) and of its successors by LEAPS.

The gateway itself publishes positions, which are of no use here. Ranges come as the user data of a tag, if its
firmware writes them there. They then have the form of the module's Bluetooth characteristic "location data":
u8 type (1: distances; 2: a position of 13 bytes, then distances), u8 count, then for each anchor u16 id, u32 mm and
u8 quality, little-endian. The 34 bytes of user data hold four anchors.
"""

import base64
import binascii
import struct
from collections.abc import Iterator
from typing import Any

from dropanchor_tag_client.sources.bridge.measurement import (
    Drop,
    Dropped,
    Format,
    Found,
    Measurement,
    Received,
    json_of,
    refused_retained,
)

_TYPE_AND_COUNT = struct.Struct("<BB")
_DISTANCE = struct.Struct("<HIB")
_DISTANCES, _POSITION_AND_DISTANCES = 1, 2
_POSITION_BYTES = 13
_NO_MEASUREMENTS = ("status", "config", "service")
_US = 1_000


class Decawave(Format):
    """topics: `dwm/node/<id>/uplink/<what>`, and LEAPS' `<prefix>/<network>/node/uplink/<what>/<id>`."""

    topics: tuple[str, ...] = ("dwm/node/+/uplink/#", "+/+/node/uplink/#")

    def parse(self, message: Received) -> Iterator[Found]:
        node, what = _node_and_what(message.topic)
        if what in _NO_MEASUREMENTS:
            return
        value = json_of(message.payload)
        if message.retained:
            yield refused_retained(message)
        elif isinstance(value, Dropped):
            yield value
        elif what == "location":
            yield Dropped(Drop.POSITION_ONLY, "the gateway's positions hold no ranges; see the user data of the tag")
        elif what == "data" and isinstance(value, dict) and isinstance(value.get("data"), str):
            yield from _ranges(node, value["data"], _time(value.get("timestamp"), message.t_ns))
        else:
            yield Dropped(Drop.NOT_UNDERSTOOD, "user data, as in dwm/node/…/uplink/data, was expected")


def _node_and_what(topic: str) -> tuple[str, str]:
    levels = topic.split("/")
    if levels[1] == "node":
        return levels[2].upper(), levels[4] if len(levels) > 4 else ""
    return levels[-1].upper(), levels[4] if len(levels) > 5 else ""


def _ranges(node: str, text: str, t_ns: int) -> Iterator[Found]:
    try:
        data = base64.b64decode(text, validate=True)
        kind, count = _TYPE_AND_COUNT.unpack_from(data)
    except (binascii.Error, struct.error, ValueError) as error:
        yield Dropped(Drop.NOT_UNDERSTOOD, f"the user data of {node} are no distances: {error}")
        return
    begin = _TYPE_AND_COUNT.size
    if kind == _POSITION_AND_DISTANCES and len(data) > 1 + _POSITION_BYTES:
        begin += _POSITION_BYTES
        count = data[begin - 1]
    if kind not in (_DISTANCES, _POSITION_AND_DISTANCES) or len(data) < begin + count * _DISTANCE.size:
        yield Dropped(Drop.NOT_UNDERSTOOD, f"the user data of {node} are no distances")
        return
    for anchor, millimetres, _quality in _DISTANCE.iter_unpack(data[begin : begin + count * _DISTANCE.size]):
        fields = {"anchor": f"{anchor:04X}", "range_m": millimetres / 1000, "t_ns": t_ns}
        yield Measurement(node, "range", fields)


def _time(timestamp: Any, arrival_ns: int) -> int:
    """Return the time of a message in ns. Newer gateways write µs as text."""
    try:
        return int(timestamp) * _US
    except (TypeError, ValueError, OverflowError):
        return arrival_ns
