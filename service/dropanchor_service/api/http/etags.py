"""Conditional requests (RFC 9110): an ETag for each resource, and the preconditions of a change."""

import hashlib
from typing import Annotated

from fastapi import Depends, Header
from pydantic import BaseModel

from dropanchor_service.store.preconditions import Precondition


def etag_of(model: BaseModel) -> str:
    """Return the entity tag of a resource: equal resources have equal tags."""
    return f'"{hashlib.sha256(model.model_dump_json().encode()).hexdigest()[:16]}"'


def matches(if_match: str | None, current: BaseModel | None) -> bool:
    """Return whether the current resource meets an `If-Match`; without the header every resource does."""
    if if_match is None:
        return True
    return current is not None and (if_match == "*" or etag_of(current) in map(str.strip, if_match.split(",")))


def _precondition(
    if_match: Annotated[
        str | None, Header(description="Change nothing unless this is the `ETag` of the current resource.")
    ] = None,
    if_none_match: Annotated[
        str | None, Header(description="`*`: change nothing if the resource exists already.", pattern=r"^\*$")
    ] = None,
) -> Precondition:
    return lambda current: matches(if_match, current) and (if_none_match is None or current is None)


Conditions = Annotated[Precondition, Depends(_precondition)]
"""The preconditions in the headers of a request."""
