"""The page of the REST interface, from the OpenAPI document."""

from typing import Any

from dropanchor_evaluation.reference.markdown import table
from dropanchor_schemas.answers import SamplesAcknowledged
from dropanchor_schemas.wire import MAX_PAYLOAD_BYTES
from dropanchor_service.api.http.errors import Kind
from dropanchor_service.api.http.server import PING_S
from dropanchor_service.api.http.web_sockets import MAX_MESSAGE_BYTES
from dropanchor_service.api.routes import ingest_stream

_INTRODUCTION = """\
# REST interface

The base path is `/api/v1`. The whole document, with every field, lies at `/api/v1/openapi.json` and in
`schemas/dropanchor_schemas/openapi.json`. SI units and radians; a heading counts counter-clockwise from east; times
are UTC in ns. With credentials, every request but those for health and the document itself carries
`Authorization: Bearer KEY`.

Every path below, but those for lists of sites, health and share links, also exists with the site before it, as
`/api/v1/sites/{site}/poses` for `/api/v1/poses`. A service with [several
sites](../how-to/serve-several-sites.md) has these alone, and not for zones, events and destinations.

Ids in a path are percent-escaped, a slash too; `.` and `..` are no ids. `tags` and `zones` list ids: `tags=a,b` or
`tags=a&tags=b`. A parameter that is repeated has one id in each value, and only then may an id have a comma:
`tags=a%2Cb&tags=c`. Given once, a comma separates, escaped as `%2C` or not; so a single id with a comma is given twice,
`tags=a%2Cb&tags=a%2Cb`. The words of `state` and `types` have no commas, and both forms do. Groups may have commas:
repeat `group`.
"""

_STREAM = """\
### Stream of samples

`GET /api/v1/ingest/stream` opens a WebSocket for the samples of one tag. OpenAPI has no WebSockets, so this section
describes it. Each message is one payload of the contract: a text message is JSON, a binary message is packed. Decoding,
admission and counters are those of samples over Zenoh.

The service answers every message with one JSON object, in the order of the messages; a greeting of the same form comes
first. It is `SamplesAcknowledged` in the document:

{fields}
**Nothing is lost** if the client keeps each message until its answer, and after a break connects and sends again what
was not answered. An answered message is in the service's buffer, and an orderly stop still uses it. After a kill,
`started_ns` differs: then the client should also send again what was answered in the last 5 s, which the last
checkpoint may lack. A message that arrives twice counts as `duplicate` and is used once, if it has `sequence` and
`boot_id`. Samples that come later than those of other publishers of the tag may be counted as `late`.

**Credentials**: the key of a tag (`dropanchor key add NAME --tag TAG`) in `Authorization: Bearer KEY`. A browser cannot
set this header: it offers the two protocols `{protocol}` and `{key_protocol}KEY`. The key chooses the tag.
Without credentials the URL names it: `?tag=NAME`. Of web pages, only those of the service's own origin and of
`http.cors_origins` are accepted.

**Limits**: {connections} connections for each key. A payload has at most {payload:,} bytes; a message of more than
{message:,} bytes ends the connection. Messages count as requests: a client that is too fast has to wait for its
answers. The service pings every {ping:.0f} s and cuts a client that does not answer within {ping:.0f} s.

The service ends a connection with one of these codes and a sentence. With `?reasons=code` it sends the code of the
sentence and its values instead, in the form of a query such as `code=other_tag&tag=%27cart%27`:

{codes}"""
_CODES = (
    (ingest_stream.UNREADABLE, "The tag is missing from the URL, or its name cannot be used."),
    (ingest_stream.UNAUTHENTICATED, "The key is missing, unknown, revoked or expired."),
    (ingest_stream.FORBIDDEN, "The key belongs to another tag or to none, or the page to another origin."),
    (ingest_stream.TOO_MANY, "The key has too many connections. Try again later."),
    (ingest_stream.RESTART, "The service stops. Connect again and send again what was not answered."),
    (1009, "The message was too large."),
)


def page(document: dict[str, Any]) -> str:
    """Return the page as Markdown. document: OpenAPI 3.1."""
    groups = [tag["name"] for tag in document["tags"]]
    sections = [_INTRODUCTION]
    for group in groups:
        rows = [row(path, method, operation) for path, method, operation in operations_in(document, group)]
        header = ("request", "answer", "query parameters", "status codes")
        sections.append(f"## {group.capitalize()}\n\n{table(header, rows)}")
        if group == "ingest":
            sections.append(_stream_of_samples())
    kinds = ((f"`{kind.type}`", str(kind.status), kind.title) for kind in Kind)
    sections.append(
        "## Errors\n\nSentences for people have a code beside them: `detail_phrase`, `hint_phrase`. Match and "
        "translate by the code, since the sentence may be reworded.\n\n"
        "Every error is `application/problem+json` (RFC 9457) of one of these types:\n\n"
        + table(("type", "status", "title"), kinds)
    )
    return "\n".join(sections)


def _stream_of_samples() -> str:
    fields = SamplesAcknowledged.model_fields.items()
    return _STREAM.format(
        fields=table(("field", "what"), ((f"`{name}`", field.description or "") for name, field in fields)),
        codes=table(("code", "when"), ((f"`{code}`", when) for code, when in _CODES)),
        protocol=ingest_stream.PROTOCOL,
        key_protocol=ingest_stream.KEY_PROTOCOL,
        connections=ingest_stream.CONNECTIONS_PER_KEY,
        payload=MAX_PAYLOAD_BYTES,
        message=MAX_MESSAGE_BYTES,
        ping=PING_S,
    )


def operations_in(document: dict[str, Any], group: str) -> list[tuple[str, str, dict[str, Any]]]:
    """Return path, method and operation of each operation of a group. A path with a site stands for one without."""
    return [
        (path, method, operation)
        for path, operations in document["paths"].items()
        for method, operation in operations.items()
        if group in operation.get("tags", []) and "{site}" not in path
    ]


def row(path: str, method: str, operation: dict[str, Any]) -> tuple[str, str, str, str]:
    """Return request, answer, query parameters and status codes of an operation."""
    query = [f"`{parameter['name']}`" for parameter in operation.get("parameters", []) if parameter["in"] == "query"]
    return f"`{method.upper()} {path}`", operation["summary"], ", ".join(query), ", ".join(operation["responses"])
