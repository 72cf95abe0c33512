"""The page of the omlox interface, from its OpenAPI document and the messages of its WebSocket."""

from typing import Any

from dropanchor_evaluation.reference.markdown import table
from dropanchor_evaluation.reference.rest_page import operations_in, row
from dropanchor_schemas.pose import TrackingState
from dropanchor_service.api.http.borders import FORBIDDEN
from dropanchor_service.api.http.web_sockets import MAX_MESSAGE_BYTES
from dropanchor_service.api.omlox.feed.messages import Code, Params
from dropanchor_service.api.omlox.feed.positions import MAX_OBJECTS
from dropanchor_service.api.omlox.feed.socket import (
    CONNECTIONS_PER_CLIENT,
    MAX_SUBSCRIPTIONS,
    PERIOD_S,
    RESTART,
    TOO_MANY,
)
from dropanchor_service.api.omlox.places import SHOWN

_INTRODUCTION = """\
# omlox interface

The base path is `/omlox/v2`, and for older clients also `/omlox/v1`. The whole document, with every field, lies at
`/omlox/v2/openapi.json`. [Use an omlox client](../how-to/use-an-omlox-client.md) explains it with examples.

Credentials and scopes are those of the [REST interface](rest.md): reading needs `read`, changing `write`, deleting
`admin`. Errors are the same problem documents, with `code` (the status) and `message` added; an invalid request has the
status 400.
"""
_OBJECTS = (
    ("`LocationProvider`", "A tag. `id` is the id of the tag, `type` is `uwb`, `name` its display name."),
    ("`Trackable`", "What carries tags. Each tag has one of its own, unless a client assigns the tag to another."),
    ("`Location`", "The pose of a tag, while its place is known."),
    ("`Zone`", "The surroundings of an anchor. `foreign_id` is the id of the anchor."),
    ("`Fence`", "A zone of the REST interface: a polygon without holes, or a circle around a point."),
    (
        "`FenceEvent`",
        "A tag that has entered or left a zone, with the certainty of an event. What is retracted comes as its "
        "opposite, with the id in `dropanchor.retracts`.",
    ),
    (
        "`CollisionEvent`",
        "Two tags for which a rule `too_close` holds. Only its begin is sent, and its end if the begin is retracted.",
    ),
)
_TOPICS = (
    ("`location_updates`", "`Location`"),
    ("`location_updates:geojson`", "one `FeatureCollection` of locations"),
    ("`trackable_motions`", "`TrackableMotion`"),
    ("`trackable_motions:geojson`", "one `FeatureCollection` of motions"),
    ("`fence_events`", "`FenceEvent`"),
    ("`fence_events:geojson`", "one `FeatureCollection` of fences with their event"),
    ("`collision_events`", "`CollisionEvent`"),
    ("`proximity_updates`", "nothing: the service has no proximity providers"),
)
_CODES = {
    Code.UNKNOWN_EVENT: "The event is neither `subscribe` nor `unsubscribe`.",
    Code.UNKNOWN_TOPIC: "There is no such topic.",
    Code.SUBSCRIPTION_FAILED: "A parameter is wrong, the site has no georeference, or the connection is full.",
    Code.UNSUBSCRIBE_FAILED: "The connection has no subscription with this number.",
    Code.NOT_AUTHORIZED: "The key lacks the scope `read`; or a client sends positions, which the service computes.",
    Code.INVALID_DATA: "The message cannot be read.",
    Code.NOT_AUTHENTICATED: "The key is missing, unknown, revoked or expired. It also ends running subscriptions.",
    Code.INVALID_LICENCE: "Never sent.",
}
_SOCKET = """\
## WebSocket

`GET /omlox/v2/ws/socket` opens it. OpenAPI has no WebSockets, so this section describes it. A client sends
`{{"event": "subscribe", "topic": TOPIC, "params": {{…}}}}` and gets `{{"event": "subscribed", "topic": TOPIC,
"subscription_id": NUMBER}}`. From then on it gets `{{"event": "message", "topic": TOPIC, "payload": [objects]}}` for
what is new. It ends a subscription with `{{"event": "unsubscribe", "subscription_id": NUMBER}}`.

{topics}
Parameters of a subscription select what is sent; each id may be a list. They are {params}.

Positions are sent up to {rate:.0f} times per second, at most {objects} in a message, and more seldom where that would
take more than a quarter of a core. A client that reads slowly gets the newest positions when it is ready again, and
every event. A key stands in the header `Authorization: Bearer KEY` of the handshake, or in `params.token`. Of web
pages, only those of the service's own origin and of `http.cors_origins` may connect.

An error is `{{"event": "error", "code": CODE, "description": "…"}}`:

{codes}
**Limits**: {connections} connections of each network address, {subscriptions} subscriptions of each connection,
{message:,} bytes for a message. Messages count as requests. The service ends a connection with {restart} when it stops,
{forbidden} for a page of another origin, and {too_many} when there are too many.
"""


def page(document: dict[str, Any]) -> str:
    """Return the page as Markdown. document: OpenAPI 3.1."""
    objects = table(("object", "what it is here"), _OBJECTS)
    states = ((f"`{state.value}`", "yes" if state in SHOWN else "no") for state in TrackingState)
    sections = [
        _INTRODUCTION,
        f"## Objects\n\n{objects}",
        "## When a tag has a location\n\n"
        + table(("state", "location"), states)
        + "\nA tag whose `frame` is `relative` has none in any state. "
        "`properties.dropanchor` of its provider and its trackable says why, and so does the error 404.\n",
    ]
    for group in ("trackables", "providers", "zones", "fences"):
        rows = [row(*operation) for operation in operations_in(document, group)]
        header = ("request", "answer", "query parameters", "status codes")
        sections.append(f"## {group.capitalize()}\n\n{table(header, rows)}")
    return "\n".join([*sections, _socket()])


def _socket() -> str:
    return _SOCKET.format(
        topics=table(("topic", "objects"), _TOPICS),
        params=", ".join(f"`{name}`" for name in Params.model_fields),
        codes=table(("code", "when"), ((f"`{code.value}`", when) for code, when in _CODES.items())),
        rate=1 / PERIOD_S,
        objects=MAX_OBJECTS,
        connections=CONNECTIONS_PER_CLIENT,
        subscriptions=MAX_SUBSCRIPTIONS,
        message=MAX_MESSAGE_BYTES,
        restart=RESTART,
        forbidden=FORBIDDEN,
        too_many=TOO_MANY,
    )
