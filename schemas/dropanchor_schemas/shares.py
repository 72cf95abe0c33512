"""Models of links that let anybody who has them look at the page until they expire."""

from typing import Self

from pydantic import Field, model_validator

from dropanchor_schemas.models import Exact, Frozen
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Id, Label

DAY_S = 86_400


class ShareRequest(Exact):
    """What to share, and for how long."""

    name: Label = Field(default="", description="What the link is for, as the list of links shows it.")
    valid_s: int = Field(default=7 * DAY_S, ge=60, le=366 * DAY_S, description="For how many seconds the link works.")
    tag: Id | None = Field(default=None, description="Show this tag only; null for all.")
    group: Label | None = Field(
        default=None, min_length=1, description="Show only tags whose settings name this group; null for all."
    )
    view: str = Field(
        default="",
        max_length=2000,
        pattern=r"^[!-~]*$",
        description="What the page shows at first: the part of its address after the `#`.",
    )

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        if self.tag is not None and self.group is not None:
            raise ValueError(say("share_both", "give a tag or a group, not both"))
        return self


class Share(Frozen):
    """A link that was created, without its secret."""

    id: str
    name: str
    made_ns: int = Field(description="UTC, ns.")
    expires_ns: int = Field(description="UTC, ns: from then on the link does not work.")
    tag: str | None
    group: str | None
    site: str = Field(description="The id of the site that the link shows.")


class NewShare(Share):
    """A new link. Its secret cannot be read again."""

    secret: str = Field(description="Works as a bearer token with the scope `read`, as far as the link reaches.")
    path: str = Field(
        description="The path of the page with the secret: the link, after the host. It begins with the path "
        "below which a proxy has the service, if there is one."
    )


class ShareList(Frozen):
    """The links that are neither revoked nor long expired."""

    available: bool = Field(
        description="Whether links can be created and revoked. They need access control, without which everybody sees "
        "everything, and a data folder that the service may write."
    )
    shares: list[Share]
