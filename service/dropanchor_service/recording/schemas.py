"""Schemas of the messages in a recording: well-known ones where there are any, by the names that viewers look for.

Names and fields of `foxglove.*`: the JSON Schemas of Foxglove's package @foxglove/schemas. Viewers take a part of JSON
Schema only: every property has one `type`, an object has `properties`, the items of an array are no arrays; a property
that has no place in that is left out of the schema, not of the message.
"""

from collections.abc import Mapping
from typing import Any

from dropanchor_service.answers.track_pages import ESTIMATED

POSE = "foxglove.PoseInFrame"
LOCATION = "foxglove.LocationFix"
TRANSFORM = "foxglove.FrameTransform"
ESTIMATE = "dropanchor.Estimate"
SAMPLES = "dropanchor.Samples"
PACKED_SAMPLES = "dropanchor.PackedSamples"
SITE = "dropanchor.Site"

Schema = Mapping[str, Any]

_NUMBER: Schema = {"type": "number"}
_INTEGER: Schema = {"type": "integer"}
_TEXT: Schema = {"type": "string"}
_BASE64: Schema = {"type": "string", "contentEncoding": "base64"}


def all_schemas() -> dict[str, Schema]:
    """JSON Schemas by name."""
    return {
        POSE: _record(timestamp=_TIME, frame_id=_TEXT, pose=_record(position=_VECTOR, orientation=_QUATERNION)),
        LOCATION: _record(
            timestamp=_TIME,
            frame_id=_TEXT,
            latitude=_NUMBER,
            longitude=_NUMBER,
            altitude=_NUMBER,
            position_covariance=_NINE,
            position_covariance_type=_INTEGER,
        ),
        TRANSFORM: _record(
            timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR, rotation=_QUATERNION
        ),
        ESTIMATE: _record(
            t_ns=_INTEGER,
            state=_TEXT,
            reason=_TEXT,
            anchor=_TEXT,
            covariance=_NINE,
            **dict.fromkeys(ESTIMATED, _NUMBER),
        ),
        SAMPLES: _record(
            sequence=_INTEGER,
            imu=_listed(t_ns=_INTEGER, acc=_numbers(3), gyro=_numbers(3)),
            range=_listed(t_ns=_INTEGER, range_m=_NUMBER),
            heading=_listed(t_ns=_INTEGER, heading_rad=_NUMBER),
            bearing=_listed(t_ns=_INTEGER, bearing_rad=_NUMBER),
        ),
        PACKED_SAMPLES: _record(data=_BASE64),
        SITE: _record(site=_record(id=_TEXT, name=_TEXT, anchors=_listed(id=_TEXT, x=_NUMBER, y=_NUMBER, z=_NUMBER))),
    }


def _record(**properties: Schema) -> Schema:
    return {"type": "object", "properties": properties}


def _listed(**properties: Schema) -> Schema:
    return {"type": "array", "items": _record(**properties)}


def _numbers(count: int) -> Schema:
    return {"type": "array", "items": _NUMBER, "minItems": count, "maxItems": count}


_TIME = _record(sec={"type": "integer", "minimum": 0}, nsec={"type": "integer", "minimum": 0, "maximum": 999_999_999})
_VECTOR = _record(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _record(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_NINE = _numbers(9)
