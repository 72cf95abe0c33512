"""Conditions under which a change may replace what is stored."""

from collections.abc import Callable

from pydantic import BaseModel

Precondition = Callable[[BaseModel | None], bool]
"""Returns whether a change may replace the current value; None: there is no value yet."""


class ChangedMeanwhileError(Exception):
    """Somebody has changed a resource since the client read it."""


def always(_current: BaseModel | None) -> bool:
    """Allow every change."""
    return True


def require(allows: Precondition, current: BaseModel | None) -> None:
    """Raise ChangedMeanwhileError unless the current value may be replaced."""
    if not allows(current):
        raise ChangedMeanwhileError
