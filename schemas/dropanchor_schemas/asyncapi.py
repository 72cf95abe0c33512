"""The AsyncAPI 3 document of the Zenoh contract: what each key carries and who publishes it.

AsyncAPI has no Zenoh binding, so Zenoh's own concepts (queryables, liveliness tokens) stand in `x-zenoh`.
"""

from typing import Any

from pydantic import BaseModel

from dropanchor_schemas import keys
from dropanchor_schemas.events import Event
from dropanchor_schemas.pose import Pose, PoseFrame
from dropanchor_schemas.samples import SamplesMessage
from dropanchor_schemas.site import Anchor, RemoteSettings
from dropanchor_schemas.tag_health import TagHealthMessage
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, HEADER, MAX_PAYLOAD_BYTES

Channels = dict[str, tuple[str, list[str], str, dict[str, Any]]]
"""The key, the messages, the description and the Zenoh details of each channel."""

_MODELS: tuple[type[BaseModel], ...] = (
    SamplesMessage,
    TagHealthMessage,
    Pose,
    PoseFrame,
    Anchor,
    RemoteSettings,
    Event,
)
_PARAMETERS = {
    "site": "Id of the site; `default` unless the settings say otherwise.",
    "tag": "Id of the tag.",
    "anchor": "Id of the anchor.",
    "service": "Id of the running service; it is new at every start.",
    "bucket": "Id of the sites that one process of a cluster owns together.",
    "epoch": "Number of the lease: it grows with each owner.",
}
_ESCAPING = "1 to 64 printable characters. All characters except A-Z a-z 0-9 . _ - are percent-escaped as UTF-8."


def document() -> dict[str, Any]:
    """Return the AsyncAPI 3.0 document, ready for JSON."""
    channels = _channels_of_tags() | _channels_of_settings_and_poses() | _channels_of_service()
    return {
        "asyncapi": "3.0.0",
        "info": {
            "title": "Dropanchor over Zenoh",
            "version": "1",
            "description": "Tags publish raw samples; the service publishes poses. Units are SI. The site frame is "
            "ENU with x east. Times are UTC in ns, unless a message declares a clock that counts from boot.",
            "license": {"name": "Apache-2.0"},
        },
        "defaultContentType": ENCODING_JSON,
        "servers": {
            "router": {
                "host": "{router}:7447",
                "protocol": "zenoh",
                "description": "A Zenoh router: the service's own or a separate one.",
                "variables": {"router": {"default": "127.0.0.1"}},
            }
        },
        "channels": {name: _channel(*channel) for name, channel in channels.items()},
        "operations": _operations(),
        "components": {"messages": _messages(), "schemas": _schemas()},
    }


def _channels_of_tags() -> Channels:
    """Return what tags send."""
    return {
        "samples": (
            _readable(keys.samples_key("{site}", "{tag}")),
            ["samplesJson", "samplesPacked"],
            "Batches of raw samples. Several publishers may feed one tag.",
            {"kind": "put", "congestionControl": "drop", "cache": "AdvancedPublisher, recommended"},
        ),
        "tagAlive": (
            _readable(keys.tag_alive_key("{site}", "{tag}")),
            [],
            "Liveliness token of a tag: present means online.",
            {"kind": "liveliness"},
        ),
        "health": (
            _readable(keys.health_key("{site}", "{tag}")),
            ["health"],
            "What a tag says about itself: battery, temperature, firmware. Optional.",
            {"kind": "put", "put": "about once a minute"},
        ),
    }


def _channels_of_settings_and_poses() -> Channels:
    """Return what the service sends about tags, for them and for others."""
    return {
        "settings": (
            _readable(keys.settings_key("{site}", "{tag}")),
            ["settings"],
            "What the program of a tag should apply. It acknowledges it in its health.",
            {"kind": ["queryable", "put"], "put": "on change"},
        ),
        "pose": (
            _readable(keys.pose_key("{site}", "{tag}")),
            ["pose"],
            "The latest pose of one tag. A query with `?at=<t_ns or ISO 8601>` returns the pose at another time.",
            {"kind": ["queryable", "put"], "put": "on change, at most 20 Hz, while there is a subscriber"},
        ),
        "poses": (
            _readable(keys.poses_key("{site}")),
            ["poseFrame"],
            "The poses of all tags in columns.",
            {"kind": "put", "put": "at most 10 Hz, while there is a subscriber"},
        ),
    }


def _channels_of_service() -> Channels:
    """Return what else the service sends and answers."""
    return {
        "event": (
            _readable(keys.event_key("{site}", "{tag}")),
            ["event"],
            "Events of one tag, in their order. What was missed is in `GET /api/v1/events`.",
            {"kind": "put", "put": "when an event is stored"},
        ),
        "anchor": (
            _readable(keys.anchor_key("{site}", "{anchor}")),
            ["anchor"],
            "The position of one anchor.",
            {"kind": "queryable"},
        ),
        "serviceAlive": (
            _readable(keys.service_alive_key("{site}", "{service}")),
            [],
            "Liveliness token of the service.",
            {"kind": "liveliness"},
        ),
        "ownerAlive": (
            _readable(keys.owner_key("{bucket}", 0)).replace("/0", "/{epoch}"),
            [],
            "Liveliness token of the owner of a bucket, in a cluster. An owner that sees a higher epoch ends.",
            {"kind": "liveliness"},
        ),
    }


def _readable(key: str) -> str:
    """Return the key with plain braces around its placeholders; `keys` percent-escapes them."""
    return key.replace("%7B", "{").replace("%7D", "}")


def _channel(address: str, messages: list[str], description: str, zenoh: dict[str, Any]) -> dict[str, Any]:
    return {
        "address": address,
        "description": description,
        "messages": {name: {"$ref": f"#/components/messages/{name}"} for name in messages},
        "parameters": {
            name: {"description": f"{text} {_ESCAPING}"}
            for name, text in _PARAMETERS.items()
            if f"{{{name}}}" in address
        },
        "x-zenoh": zenoh,
    }


def _operations() -> dict[str, Any]:
    """Return the operations of the service: it receives the tags' messages and sends poses."""
    received = ("samples", "tagAlive", "health")
    sent = ("settings", "pose", "poses", "event", "anchor", "serviceAlive", "ownerAlive")
    return {
        f"{action}{name[0].upper()}{name[1:]}": {"action": action, "channel": {"$ref": f"#/channels/{name}"}}
        for action, names in (("receive", received), ("send", sent))
        for name in names
    }


def _messages() -> dict[str, Any]:
    return {
        "samplesJson": _json_message(SamplesMessage, "The canonical form, which any program can send."),
        "samplesPacked": {
            "contentType": ENCODING_PACKED,
            "summary": "Packed little-endian records for microcontrollers and high rates.",
            "payload": {
                "type": "string",
                "format": "binary",
                "minLength": HEADER.size,
                "maxLength": MAX_PAYLOAD_BYTES,
                "description": "The README of dropanchor-schemas describes the layout byte by byte.",
            },
        },
        "health": _json_message(TagHealthMessage, "The values that the tag knows; the others are left out."),
        "settings": _json_message(RemoteSettings, "What is null is up to the program."),
        "pose": _json_message(Pose, "One pose with its state, reason and covariance."),
        "poseFrame": _json_message(PoseFrame, "Entry i of every column belongs to tag i."),
        "event": _json_message(Event, "A CloudEvent 1.0 in structured JSON."),
        "anchor": _json_message(Anchor, "One anchor in the site frame."),
    }


def _json_message(model: type[BaseModel], summary: str) -> dict[str, Any]:
    return {
        "contentType": ENCODING_JSON,
        "summary": summary,
        "payload": {"$ref": f"#/components/schemas/{model.__name__}"},
    }


def _schemas() -> dict[str, Any]:
    """Return the JSON Schemas of all models; shared definitions appear once."""
    schemas: dict[str, Any] = {}
    for model in _MODELS:
        schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
        schemas |= schema.pop("$defs", {}) | {model.__name__: schema}
    return schemas
