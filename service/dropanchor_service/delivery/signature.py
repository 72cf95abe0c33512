"""Sign requests as the specification "Standard Webhooks" says, so that receivers can use its libraries."""

import base64
import binascii
import hashlib
import hmac
from collections.abc import Mapping

from dropanchor_schemas.destinations import SECRET_PREFIX
from dropanchor_schemas.sentences import say

MIN_BYTES, MAX_BYTES = 24, 64


class SecretError(ValueError):
    """The secret cannot be used. The message does not contain it."""


def key_of(secret: str) -> bytes:
    """Return the bytes of a secret. Raises SecretError."""
    try:
        key = base64.b64decode(secret.removeprefix(SECRET_PREFIX), validate=True)
    except (binascii.Error, ValueError) as error:
        raise SecretError(_ADVICE) from error
    if not secret.startswith(SECRET_PREFIX) or not MIN_BYTES <= len(key) <= MAX_BYTES:
        raise SecretError(_ADVICE)
    return key


def headers(secret: str, event_id: str, timestamp_s: int, body: bytes) -> Mapping[str, str]:
    """Return the headers that let the receiver check origin, content and age of a request."""
    signed = f"{event_id}.{timestamp_s}.".encode() + body
    digest = hmac.new(key_of(secret), signed, hashlib.sha256).digest()
    return {
        "webhook-id": event_id,
        "webhook-timestamp": str(timestamp_s),
        "webhook-signature": f"v1,{base64.b64encode(digest).decode()}",
    }


_ADVICE = say(
    "secret_form",
    "a secret is `{prefix}` and the Base64 of {least} to {most} random bytes: the page makes one (New secret)",
    prefix=SECRET_PREFIX,
    least=MIN_BYTES,
    most=MAX_BYTES,
)
