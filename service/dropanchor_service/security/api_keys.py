"""API keys: random secrets, of which only the SHA-256 is kept.

A secret has 256 random bits, so that a slow password hash would add nothing but a way to keep the service busy.
"""

import hashlib
import hmac
import json
import logging
import secrets
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.security.files import PRIVATE, one_at_a_time
from dropanchor_service.security.identity import Identity, Scope, UnauthenticatedError

FILE = "api_keys.json"
SOURCE = "key"
PREFIX = "dropanchor_"
CHECK_S = 1.0  # a change of the file counts after so long

_log = logging.getLogger(__name__)


class ApiKeyError(ValueError):
    """A key that cannot be made or revoked; the message says why."""


class ApiKey(BaseModel):
    """What is kept of a key."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    scope: Scope
    sha256: str
    made: datetime
    expires: datetime | None = None

    @property
    def is_expired(self) -> bool:
        return self.expires is not None and self.expires <= datetime.now(UTC)


_KEYS = TypeAdapter(dict[str, ApiKey])  # by the id in the key


class ApiKeys:
    """The keys in a file, which other processes may change: a key works, or works no more, within a second."""

    takes_time = False

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic) -> None:
        """Raises ApiKeyError when the file is damaged."""
        self._file = folder / FILE
        self._clock = clock
        self._checked_s = clock()
        self._version = self._version_now()
        self._keys = self._read()

    def all(self) -> Mapping[str, ApiKey]:
        return self._keys

    def add(self, name: str, scope: Scope, days: int | None = None) -> str:
        """The key, which nobody can read again. Raises ApiKeyError."""
        with one_at_a_time(self._file.parent):
            keys = self._read()
            if any(key.name == name for key in keys.values()):
                raise ApiKeyError(f"there is a key {name!r}; revoke it first, or choose another name")
            identifier, made = secrets.token_hex(4), datetime.now(UTC)
            secret = f"{PREFIX}{identifier}_{secrets.token_urlsafe(32)}"
            expires = None if days is None else made + timedelta(days=days)
            keys[identifier] = ApiKey(name=name, scope=scope, sha256=_hash(secret), made=made, expires=expires)
            self._write(keys)
        return secret

    def revoke(self, name: str) -> None:
        """Raises ApiKeyError."""
        with one_at_a_time(self._file.parent):
            keys = self._read()
            left = {identifier: key for identifier, key in keys.items() if key.name != name}
            if len(left) == len(keys):
                raise ApiKeyError(f"there is no key {name!r}")
            self._write(left)

    def knows(self, secret: str) -> bool:
        return secret.startswith(PREFIX)

    def identify(self, secret: str) -> Identity:
        """Raises UnauthenticatedError."""
        self._follow_file()
        key = self._keys.get(secret.removeprefix(PREFIX).partition("_")[0])
        if key is None or not hmac.compare_digest(key.sha256, _hash(secret)):
            raise UnauthenticatedError("the API key is not known, or was revoked")
        if key.is_expired:
            raise UnauthenticatedError("the API key has expired")
        return Identity(SOURCE, key.name, key.scope)

    def is_still_good(self, identity: Identity) -> bool:
        self._follow_file()
        return any(key.name == identity.name and not key.is_expired for key in self._keys.values())

    def _follow_file(self) -> None:
        if self._clock() - self._checked_s < CHECK_S:
            return
        self._checked_s = self._clock()
        version = self._version_now()
        if version == self._version:
            return
        self._version = version
        try:
            self._keys = self._read()
        except ApiKeyError as error:
            _log.error("%s; the keys that were known before still count", error)

    def _version_now(self) -> tuple[int, int] | None:
        try:
            status = self._file.stat()
        except FileNotFoundError:
            return None
        return status.st_mtime_ns, status.st_ino

    def _read(self) -> dict[str, ApiKey]:
        try:
            return _KEYS.validate_json(self._file.read_bytes())
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise ApiKeyError(f"{self._file} cannot be read: {error.strerror}") from error
        except ValidationError as error:
            raise ApiKeyError(f"{self._file} is damaged") from error

    def _write(self, keys: Mapping[str, ApiKey]) -> None:
        content = json.dumps(_KEYS.dump_python(dict(keys), mode="json"), indent=2, ensure_ascii=False)
        write_atomically(self._file, [content.encode(), b"\n"], PRIVATE)
        self._keys, self._version = dict(keys), self._version_now()


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
