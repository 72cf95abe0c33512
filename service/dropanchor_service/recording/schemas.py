"""JSON Schemas of the messages in a recording, under the names that viewers look for.

The names and fields of `foxglove.*` follow the JSON Schemas of Foxglove's package @foxglove/schemas. Viewers support
only a part of JSON Schema: every property has one `type`, an object has `properties`, and the items of an array are
not arrays. Properties that do not fit are left out of the schema, but not of the message.
"""

from collections.abc import Mapping
from typing import Any

from dropanchor_schemas.kinds import SCALARS
from dropanchor_service.history.records import ESTIMATED

POSE = "foxglove.PoseInFrame"
LOCATION = "foxglove.LocationFix"
TRANSFORM = "foxglove.FrameTransform"
ESTIMATE = "dropanchor.Estimate"
SAMPLES = "dropanchor.Samples"
PACKED_SAMPLES = "dropanchor.PackedSamples"
SITE = "dropanchor.Site"
OF_RELATIVE = ("x", "y", "heading_rad", "p_mode", "sigma_pos_m")
"""Numbers of a place in a frame of the tag's own."""

Schema = Mapping[str, Any]

_NUMBER: Schema = {"type": "number"}
_INTEGER: Schema = {"type": "integer"}
_TEXT: Schema = {"type": "string"}
_BASE64: Schema = {"type": "string", "contentEncoding": "base64"}


def all_schemas() -> dict[str, Schema]:
    """Return all JSON Schemas by name."""
    return {
        POSE: _object(timestamp=_TIME, frame_id=_TEXT, pose=_object(position=_VECTOR, orientation=_QUATERNION)),
        LOCATION: _object(
            timestamp=_TIME,
            frame_id=_TEXT,
            latitude=_NUMBER,
            longitude=_NUMBER,
            altitude=_NUMBER,
            position_covariance=_NINE,
            position_covariance_type=_INTEGER,
        ),
        TRANSFORM: _object(
            timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR, rotation=_QUATERNION
        ),
        ESTIMATE: _object(
            t_ns=_INTEGER,
            covariance=_NINE,
            **dict.fromkeys(("state", "reason", "frame", "anchor", "z_source"), _TEXT),
            **dict.fromkeys(ESTIMATED, _NUMBER),
            relative_pose=_object(**dict.fromkeys(OF_RELATIVE, _NUMBER), covariance=_NINE),
        ),
        SAMPLES: _object(
            sequence=_INTEGER,
            imu=_array_of(t_ns=_INTEGER, acc=_numbers(3), gyro=_numbers(3)),
            **{kind.name: _array_of(t_ns=_INTEGER, **{kind.value: _NUMBER}) for kind in SCALARS},
        ),
        PACKED_SAMPLES: _object(data=_BASE64),
        SITE: _object(site=_object(id=_TEXT, name=_TEXT, anchors=_array_of(id=_TEXT, x=_NUMBER, y=_NUMBER, z=_NUMBER))),
    }


def _object(**properties: Schema) -> Schema:
    return {"type": "object", "properties": properties}


def _array_of(**properties: Schema) -> Schema:
    return {"type": "array", "items": _object(**properties)}


def _numbers(count: int) -> Schema:
    return {"type": "array", "items": _NUMBER, "minItems": count, "maxItems": count}


_TIME = _object(sec={"type": "integer", "minimum": 0}, nsec={"type": "integer", "minimum": 0, "maximum": 999_999_999})
_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_NINE = _numbers(9)
