"""Who changes what: each store tells its trail of a change before it saves it."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from pydantic import BaseModel


class Who(NamedTuple):
    """source: `key`, `token`, `local` for somebody where there is no access control, or `service`. name: of the key, or
    the subject of the token."""

    source: str
    name: str = ""


WHO: ContextVar[Who] = ContextVar("who")
"""Who makes the request that this thread or task works on. The access control sets it for each request."""
SERVICE = Who("service")


def _whole(value: BaseModel) -> BaseModel:
    return value


@dataclass
class Change:
    """kind: such as `anchor`. item: its id. before, after: None where there was or will be none.

    shown: returns what of them may be read again. What is not known before the change is made, such as a new id, may be
    corrected until its context ends.
    """

    kind: str
    item: str
    before: BaseModel | None
    after: BaseModel | None
    shown: Callable[[Any], BaseModel] = _whole

    @property
    def is_none(self) -> bool:
        return self.before is not None and self.before == self.after


class Trail(Protocol):
    def changing(self, change: Change) -> AbstractContextManager[Change]:
        """Note a change that is made in this context. One that fails there is taken off.

        Raises OSError, before anything is changed, when it cannot be noted.
        """


class NoTrail:
    """Keeps nothing."""

    @contextmanager
    def changing(self, change: Change) -> Iterator[Change]:
        yield change


NO_TRAIL = NoTrail()
