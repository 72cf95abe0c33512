"""Share links: tokens (JWT) that the service signs itself, with which anybody may look until they expire."""

import json
import secrets
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from pydantic import TypeAdapter

from dropanchor_schemas.sentences import say
from dropanchor_schemas.shares import Share, ShareRequest
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.security.files import PRIVATE, exclusive_lock, may_write
from dropanchor_service.security.identity import Authenticator, Identity, Limit, Scope, UnauthenticatedError

SOURCE = say("source_link", "share link")
PREFIX = "dropanchor_share_"
KEY_FILE, TABLE_FILE = "share_key", "share_links.json"
KEY_BYTES = 32
MAX_LINKS = 1000  # of a site
LISTED_S = 30 * 86_400  # how long an expired link stays in the list
NS = 1_000_000_000

_ALGORITHM = "HS256"
_AUDIENCE = "dropanchor-share"
_TABLE = TypeAdapter(dict[str, Share])
ENDED = say("links_ended", "all share links have ended")


class TooManyLinksError(Exception):
    """The site has MAX_LINKS links."""


class ShareLinks:
    """The links of all sites, whose key and list are in a folder.

    A link works in its site alone, while it is in the list and has not expired.
    """

    may_block = False

    def __init__(
        self,
        folder: Path,
        clock: Callable[[], float] = time.time,
        recovery: Recovery | None = None,
    ) -> None:
        """Read the key and the list, or create the key. What is damaged ends all links, and `recovery` reports it.

        Raises NewerFileError.

        clock: Unix time.
        """
        self._recovery = recovery or Recovery()
        self._clock = clock
        self._file = folder / TABLE_FILE
        self._key = self._key_in(folder / KEY_FILE)
        self._lock = Lock()
        self._links = self._read()

    @property
    def can_change(self) -> bool:
        """Whether links can be created and revoked."""
        return may_write(self._file.parent)

    def of_site(self, site: str) -> Sequence[Share]:
        """Return the links of a site, the first to expire first."""
        return sorted((link for link in self._links.values() if link.site == site), key=lambda one: one.expires_ns)

    def add(self, site: str, request: ShareRequest) -> tuple[Share, str]:
        """Create a link of a site and return it with its token. Raises TooManyLinksError and OSError."""
        now_s = self._clock()
        link = Share(
            id=secrets.token_hex(8),
            name=request.name,
            made_ns=int(now_s * NS),
            expires_ns=int(now_s + request.valid_s) * NS,
            tag=request.tag,
            group=request.group,
            site=site,
        )
        with self._changing():
            listed = {key: old for key, old in self._links.items() if old.expires_ns / NS > now_s - LISTED_S}
            if sum(other.site == site for other in listed.values()) >= MAX_LINKS:
                raise TooManyLinksError
            self._write(listed | {link.id: link})
        claims = {"jti": link.id, "aud": _AUDIENCE, "exp": link.expires_ns // NS, "tag": link.tag, "group": link.group}
        import jwt  # with its cryptography, 3 MB of memory, only where there are links

        return link, PREFIX + jwt.encode(claims, self._key, _ALGORITHM)

    def revoke(self, site: str, identifier: str) -> bool:
        """Remove a link of a site, which ends its streams. Return whether there was one. Raises OSError."""
        with self._changing():
            if identifier not in self._links or self._links[identifier].site != site:
                return False
            self._write({key: link for key, link in self._links.items() if key != identifier})
        return True

    def recognises(self, secret: str) -> bool:
        return secret.startswith(PREFIX)

    def identify(self, secret: str) -> Identity:
        """Return the identity of a token. Raises UnauthenticatedError when it is invalid, revoked or expired."""
        import jwt

        try:
            claims = jwt.decode(
                secret.removeprefix(PREFIX),
                self._key,
                [_ALGORITHM],
                audience=_AUDIENCE,
                options={"verify_exp": False, "require": ["jti", "exp", "aud"]},  # `exp` is judged by our own clock
            )
        except jwt.PyJWTError as error:
            raise UnauthenticatedError(
                say("why_link_damaged", "the share link is damaged, or another service made it")
            ) from error
        link = self._links.get(str(claims["jti"]))
        if self._clock() >= claims["exp"]:
            raise UnauthenticatedError(say("why_link_expired", "the share link has expired"))
        if link is None:
            raise UnauthenticatedError(say("why_link_revoked", "the share link was revoked"))
        limit = None if link.tag is None and link.group is None else Limit(link.tag, link.group)
        return Identity(SOURCE, link.id, None, link.expires_ns / NS, limit=limit, of_sites={link.site: Scope.READ})

    def is_still_valid(self, identity: Identity) -> bool:
        return identity.name in self._links and self._clock() < (identity.expires_s or 0.0)

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Lock the folder and read the list again, so that no change of another thread or process is lost.

        Raises OSError.
        """
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._lock, exclusive_lock(self._file.parent):
            self._links = self._read()
            yield

    def _read(self) -> Mapping[str, Share]:
        """Return the list. There is no copy of it: that could have a link which was revoked since."""
        return self._recovery.read_alone(self._file, _TABLE.validate_json, ENDED) or {}

    def _key_in(self, path: Path) -> bytes:
        """Return the key in a file, which is created if it is missing."""
        found = self._recovery.read_alone(path, _checked_key, ENDED)
        if found is not None:
            return found
        key = secrets.token_bytes(KEY_BYTES)
        try:
            write_atomically(path, [key], PRIVATE)
        except OSError as error:
            self._recovery.note(
                say(
                    "file_unwritten",
                    "{file} cannot be written ({why}): share links end with this process",
                    file=path.name,
                    why=error.strerror,
                )
            )
        return key

    def _write(self, links: Mapping[str, Share]) -> None:
        content = json.dumps(_TABLE.dump_python(dict(links), mode="json"), indent=2, ensure_ascii=False)
        write_atomically(self._file, [content.encode(), b"\n"], PRIVATE)
        self._links = dict(links)


def share_links_of(authenticator: Authenticator | None) -> ShareLinks | None:
    """Return the share links that this authenticator accepts; None when it accepts none."""
    links = None if authenticator is None else authenticator.provider(SOURCE)
    return links if isinstance(links, ShareLinks) else None


def _checked_key(content: bytes) -> bytes:
    if len(content) != KEY_BYTES:
        raise ValueError
    return content
