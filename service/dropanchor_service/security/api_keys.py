"""API keys: random secrets, of which the service stores only the SHA-256.

A secret has 256 random bits, so a slow password hash would not make it safer. It would only help to overload the
service.
"""

import hashlib
import hmac
import json
import logging
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id, refuse_pattern
from dropanchor_schemas.models import Exact
from dropanchor_schemas.sentences import say
from dropanchor_service.runtime.atomic_file import sync_folder, write_atomically
from dropanchor_service.runtime.written_by import later_in, mark
from dropanchor_service.security.files import PRIVATE, exclusive_lock, may_write
from dropanchor_service.security.identity import Authenticator, Identity, Scope, UnauthenticatedError

FOLDER = "keys"  # of its own, so that a service may write it and nothing else of the credentials
FILE = f"{FOLDER}/api_keys.json"
FORMER_FILE = "api_keys.json"
SOURCE = say("source_key", "key")
PREFIX = "dropanchor_"
CHECK_S = 1.0  # how often to look for changes of the file

_log = logging.getLogger(__name__)


class ApiKeyError(ValueError):
    """A key cannot be created or revoked; the message says why."""


class ApiKey(Exact):
    """The stored record of a key, without its secret. It has either a scope or a tag, whose samples it may send.

    site: the only site that the key is for; None: every site that the service has.
    """

    name: str
    scope: Scope | None
    sha256: str
    made: datetime
    expires: datetime | None = None
    tag: str | None = None
    site: str | None = None

    @property
    def permission(self) -> str:
        """What the key allows, in words."""
        where = "" if self.site is None else f" in site {self.site!r}"
        if self.tag is not None:
            return f"ingest of tag {self.tag!r}{where}"
        return "nothing" if self.scope is None else f"{self.scope.word}{where}"

    @property
    def is_expired(self) -> bool:
        return self.expires is not None and self.expires <= datetime.now(UTC)


_KEYS = TypeAdapter(dict[str, ApiKey])  # by the id that is part of the key


class ApiKeys:
    """The API keys in a file. Other processes may change it; a new or revoked key takes effect within a second."""

    may_block = False

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic, is_copied: bool = False) -> None:
        """Read the keys in `folder`. Raises ApiKeyError when the file is damaged.

        is_copied: whether other machines have the same keys, so that they are not changed in one place.
        """
        self._file, self._former = folder / FILE, folder / FORMER_FILE
        self._is_copied = is_copied
        self._clock = clock
        self._checked_s = clock()
        self._version = self._file_version()
        self._keys = self._read()

    @property
    def can_change(self) -> bool:
        """Whether keys can be made and revoked here."""
        return not self._is_copied and may_write(self._file.parent)

    def all(self) -> Mapping[str, ApiKey]:
        """Return the keys by id."""
        self._reload_if_changed()
        return self._keys

    def add(self, name: str, scope: Scope, days: int | None = None, site: str | None = None) -> str:
        """Create a key and return its secret, which cannot be read again later.

        days: the lifetime; None for a key that never expires. site: the only one that it is for; None: every site.
        Raises ApiKeyError when the name is taken.
        """
        return self._add(name, days, scope=scope, site=site)

    def add_for_tag(self, name: str, tag: str, days: int | None = None, site: str | None = None) -> str:
        """Create a key that may send the samples of this tag and nothing else; otherwise as `add`."""
        try:
            chunk_from_id(tag)
            refuse_pattern(tag)
        except InvalidKeyError as error:
            raise ApiKeyError(str(error)) from error
        return self._add(name, days, tag=tag, site=site)

    def _add(
        self,
        name: str,
        days: int | None,
        scope: Scope | None = None,
        tag: str | None = None,
        site: str | None = None,
    ) -> str:
        with self._changing():
            keys = self._read()
            if any(key.name == name for key in keys.values()):
                raise ApiKeyError(f"a key named {name!r} exists already; revoke it first, or choose another name")
            identifier, made = secrets.token_hex(4), datetime.now(UTC)
            secret = f"{PREFIX}{identifier}_{secrets.token_urlsafe(32)}"
            expires = None if days is None else made + timedelta(days=days)
            keys[identifier] = ApiKey(
                name=name, scope=scope, sha256=_hash(secret), made=made, expires=expires, tag=tag, site=site
            )
            self._write(keys)
        return secret

    def revoke(self, name: str) -> None:
        """Remove the key with this name. Raises ApiKeyError when there is none."""
        with self._changing():
            keys = self._read()
            remaining = {identifier: key for identifier, key in keys.items() if key.name != name}
            if len(remaining) == len(keys):
                raise ApiKeyError(f"there is no key named {name!r}")
            self._write(remaining)

    def revoke_id(self, identifier: str) -> bool:
        """Remove the key with this id. Return whether there was one. Raises ApiKeyError when the file is damaged."""
        with self._changing():
            keys = self._read()
            is_known = keys.pop(identifier, None) is not None
            if is_known:
                self._write(keys)
        return is_known

    def recognises(self, secret: str) -> bool:
        return secret.startswith(PREFIX)

    def identify(self, secret: str) -> Identity:
        """Return the identity of a key. Raises UnauthenticatedError when it is unknown, revoked or expired."""
        self._reload_if_changed()
        identifier = secret.removeprefix(PREFIX).partition("_")[0]
        key = self._keys.get(identifier)
        if key is None or not hmac.compare_digest(key.sha256, _hash(secret)):
            raise UnauthenticatedError(say("why_key_unknown", "the API key is unknown or was revoked"))
        if key.is_expired:
            raise UnauthenticatedError(say("why_key_expired", "the API key has expired"))
        if key.site is None or key.scope is None:
            return Identity(SOURCE, key.name, key.scope, tag=key.tag, site=key.site, key=identifier)
        return Identity(SOURCE, key.name, None, of_sites={key.site: key.scope}, key=identifier)

    def is_still_valid(self, identity: Identity) -> bool:
        self._reload_if_changed()
        key = None if identity.key is None else self._keys.get(identity.key)
        return key is not None and not key.is_expired

    def _reload_if_changed(self) -> None:
        if self._clock() - self._checked_s < CHECK_S:
            return
        self._checked_s = self._clock()
        version = self._file_version()
        if version == self._version:
            return
        try:
            self._keys = self._read()
        except ApiKeyError as error:
            _log.error("%s; the keys read before stay valid until the file is repaired", error)
        self._version = version  # last: if another thread wrote meanwhile, the next look reads its keys

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Lock the file, so that no change of another process is lost. Raises FolderInUseError and OSError."""
        folder = self._file.parent
        if not folder.exists():
            folder.mkdir(mode=0o700, exist_ok=True)
            sync_folder(folder.parent)
        with exclusive_lock(folder):
            yield

    @property
    def _newest(self) -> Path:
        """The file, or that of an earlier version as long as nothing has changed since."""
        return self._file if self._file.exists() else self._former

    def _file_version(self) -> tuple[int, int] | None:
        try:
            status = self._newest.stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_ino

    def _read(self) -> dict[str, ApiKey]:
        file = self._file
        try:
            file = self._newest
            return _KEYS.validate_json(file.read_bytes())
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise ApiKeyError(f"{file} cannot be read: {error.strerror}") from error
        except ValidationError as error:
            raise ApiKeyError(later_in(file, error) or f"{file} is damaged") from error

    def _write(self, keys: Mapping[str, ApiKey]) -> None:
        document = _KEYS.dump_python(dict(keys), mode="json")
        for key in document.values():
            if key["site"] is None:
                del key["site"]
        content = json.dumps(document, indent=2, ensure_ascii=False)
        mark(self._file.parent)
        write_atomically(self._file, [content.encode(), b"\n"], PRIVATE)
        with suppress(OSError):  # an earlier version must not accept what is revoked from now on
            self._former.unlink()
        self._keys, self._version = dict(keys), self._file_version()


def api_keys_of(authenticator: Authenticator | None) -> ApiKeys | None:
    """Return the API keys that this authenticator accepts; None when it accepts none."""
    keys = None if authenticator is None else authenticator.provider(SOURCE)
    return keys if isinstance(keys, ApiKeys) else None


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
