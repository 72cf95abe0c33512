"""Why the service ends a WebSocket, in the few bytes that the protocol has for it."""

from urllib.parse import urlencode

from starlette.datastructures import QueryParams
from starlette.types import Scope

from dropanchor_schemas.sentences import Sentence

ASKS = ("reasons", "code")
"""With this in its query, a client gets the code of a reason and its values, in the form of a query."""
_MAX_BYTES = 123


def reason_of(text: str, scope: Scope) -> str:
    """Return the reason for this client: the sentence, or what stands for it where that is asked for and fits."""
    name, value = ASKS
    if isinstance(text, Sentence) and QueryParams(scope["query_string"]).get(name) == value:
        values = {name: inner for name, inner in text.values.items() if f"{name}.code" not in text.values}
        coded = urlencode({"code": text.code, **values})
        if len(coded) <= _MAX_BYTES:
            return coded
    return text.encode()[:_MAX_BYTES].decode(errors="ignore")
