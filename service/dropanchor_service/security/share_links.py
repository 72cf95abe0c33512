"""Share links: tokens (JWT) that the service signs itself, with which anybody may look until they expire."""

import json
import secrets
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock

import jwt
from pydantic import TypeAdapter, ValidationError

from dropanchor_schemas.shares import Share, ShareRequest
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.security.files import PRIVATE
from dropanchor_service.security.identity import Authenticator, Identity, Limit, Scope, UnauthenticatedError

SOURCE = "share link"
PREFIX = "dropanchor_share_"
KEY_FILE, TABLE_FILE = "share_key", "share_links.json"
KEY_BYTES = 32
MAX_LINKS = 1000
LISTED_S = 30 * 86_400  # how long an expired link stays in the list
NS = 1_000_000_000

_ALGORITHM = "HS256"
_AUDIENCE = "dropanchor-share"
_TABLE = TypeAdapter(dict[str, Share])


class ShareLinkError(ValueError):
    """The links cannot be read; the message says why."""


class TooManyLinksError(Exception):
    """There are MAX_LINKS links."""


class ShareLinks:
    """The links whose key and list are in a folder. A link works while it is in the list and has not expired."""

    may_block = False

    def __init__(self, folder: Path, clock: Callable[[], float] = time.time) -> None:
        """Read the key and the list, or create the key. clock: Unix time. Raises ShareLinkError and OSError."""
        self._clock = clock
        self._file = folder / TABLE_FILE
        self._key = _key_in(folder / KEY_FILE)
        self._lock = Lock()
        self._links = self._read()

    def all(self) -> Mapping[str, Share]:
        return self._links

    def add(self, request: ShareRequest) -> tuple[Share, str]:
        """Create a link and return it with its token. Raises TooManyLinksError and OSError."""
        now_s = self._clock()
        link = Share(
            id=secrets.token_hex(8),
            name=request.name,
            made_ns=int(now_s * NS),
            expires_ns=int(now_s + request.valid_s) * NS,
            tag=request.tag,
            group=request.group,
        )
        with self._lock:
            listed = {key: old for key, old in self._links.items() if old.expires_ns / NS > now_s - LISTED_S}
            if len(listed) >= MAX_LINKS:
                raise TooManyLinksError
            self._write(listed | {link.id: link})
        claims = {"jti": link.id, "aud": _AUDIENCE, "exp": link.expires_ns // NS, "tag": link.tag, "group": link.group}
        return link, PREFIX + jwt.encode(claims, self._key, _ALGORITHM)

    def revoke(self, identifier: str) -> bool:
        """Remove a link, which ends its streams. Return whether there was one. Raises OSError."""
        with self._lock:
            if identifier not in self._links:
                return False
            self._write({key: link for key, link in self._links.items() if key != identifier})
        return True

    def recognises(self, secret: str) -> bool:
        return secret.startswith(PREFIX)

    def identify(self, secret: str) -> Identity:
        """Return the identity of a token. Raises UnauthenticatedError when it is invalid, revoked or expired."""
        try:
            claims = jwt.decode(
                secret.removeprefix(PREFIX),
                self._key,
                [_ALGORITHM],
                audience=_AUDIENCE,
                options={"verify_exp": False, "require": ["jti", "exp", "aud"]},  # `exp` is judged by our own clock
            )
        except jwt.PyJWTError as error:
            raise UnauthenticatedError("the share link is damaged, or another service made it") from error
        link = self._links.get(str(claims["jti"]))
        if self._clock() >= claims["exp"]:
            raise UnauthenticatedError("the share link has expired")
        if link is None:
            raise UnauthenticatedError("the share link was revoked")
        limit = None if link.tag is None and link.group is None else Limit(link.tag, link.group)
        return Identity(SOURCE, link.id, Scope.READ, link.expires_ns / NS, limit=limit)

    def is_still_valid(self, identity: Identity) -> bool:
        return identity.name in self._links and self._clock() < (identity.expires_s or 0.0)

    def _read(self) -> Mapping[str, Share]:
        try:
            return _TABLE.validate_json(self._file.read_bytes())
        except FileNotFoundError:
            return {}
        except ValidationError as error:
            raise ShareLinkError(f"{self._file} is damaged: delete it, which ends all share links") from error

    def _write(self, links: Mapping[str, Share]) -> None:
        content = json.dumps(_TABLE.dump_python(dict(links), mode="json"), indent=2, ensure_ascii=False)
        write_atomically(self._file, [content.encode(), b"\n"], PRIVATE)
        self._links = dict(links)


def share_links_of(authenticator: Authenticator | None) -> ShareLinks | None:
    """Return the share links that this authenticator accepts; None when it accepts none."""
    links = None if authenticator is None else authenticator.provider(SOURCE)
    return links if isinstance(links, ShareLinks) else None


def _key_in(path: Path) -> bytes:
    """Return the key in a file, which is created if it is missing."""
    try:
        key = path.read_bytes()
    except FileNotFoundError:
        key = secrets.token_bytes(KEY_BYTES)
        write_atomically(path, [key], PRIVATE)
    if len(key) != KEY_BYTES:
        raise ShareLinkError(f"{path} is damaged: delete it, which ends all share links")
    return key
