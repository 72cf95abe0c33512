"""Models of API keys that administrators hand out on the page."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from dropanchor_schemas.keys import refuse_pattern
from dropanchor_schemas.models import Exact, Frozen
from dropanchor_schemas.sentences import say
from dropanchor_schemas.site import Id, Label

KeyScope = Literal["read", "write"]


class KeyRequest(Exact):
    """Who gets a key, and for what: a scope, or the samples of a tag."""

    name: Annotated[Label, Field(min_length=1)] = Field(description="Of the person or program that gets it.")
    scope: KeyScope | None = Field(default=None, description="What it allows. A key for `admin` needs the command.")
    tag: Id | None = Field(default=None, description="The tag whose samples it may send, such as that of a phone.")
    days: int = Field(default=90, ge=1, le=366, description="For how many days it works.")

    @model_validator(mode="after")
    def _one_use(self) -> Self:
        if (self.scope is None) == (self.tag is None):
            raise ValueError(say("key_use", "give a scope or a tag"))
        if self.tag is not None:
            refuse_pattern(self.tag)
        return self


class AccessKey(Frozen):
    """A key, without its secret."""

    id: str
    name: str
    scope: KeyScope | None
    tag: str | None
    made_ns: int = Field(description="UTC, ns.")
    expires_ns: int | None = Field(description="UTC, ns: from then on it does not work; null: never.")


class NewAccessKey(AccessKey):
    """A new key. Its secret cannot be read again."""

    secret: str = Field(description="Works as a bearer token.")


class AccessKeyList(Frozen):
    """The keys of a site, but for those of administrators."""

    available: bool = Field(
        description="Whether keys can be created and revoked here. They need access control, without which nobody "
        "needs one, and a folder `keys` of the credentials that the service may write."
    )
    keys: list[AccessKey]
