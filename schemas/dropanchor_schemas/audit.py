"""Models of the audit trail: who changed which setting, when, and what it was before."""

from typing import Any, Literal

from pydantic import Field

from dropanchor_schemas.models import Frozen

AuditKind = Literal[
    "site",
    "anchor",
    "tag",
    "remote-settings",
    "zone",
    "rule",
    "alarm",
    "plan",
    "plan-image",
    "destination",
    "receiver-network",
    "key",
    "share",
    "omlox-trackable",
    "omlox-tag-trackable",
    "omlox-provider",
    "omlox-fence",
]
SECRET_KINDS = ("key", "share")
"""Kinds that administrators alone may read, as what they are about."""


class Author(Frozen):
    """Who changed something."""

    source: Literal["key", "token", "local", "service"] = Field(
        description="local: somebody, without access control; service: the service itself, as with the anchor of the "
        "first range."
    )
    name: str = Field(description="The name of the key, or the subject of the token; otherwise empty.")


class AuditEntry(Frozen):
    """A change."""

    number: int = Field(description="Its position in the trail. Numbers grow, and some are missing.")
    t_ns: int = Field(description="UTC, ns.")
    by: Author
    kind: AuditKind = Field(description="What was changed.")
    item: str = Field(description="The id of what was changed; of a key its name.")
    before: Any = Field(description="What there was before; null: nothing. Secrets are left out.")
    after: Any = Field(description="What there is since; null: nothing.")
    confirmed: bool = Field(
        description="false: the service ended while it made the change, which may or may not have happened."
    )


class AuditList(Frozen):
    """A page of the trail, the newest first."""

    entries: list[AuditEntry]
    next: int | None = Field(description="`before` of the next page; null: there is none.")
