"""What models share."""

from pydantic import BaseModel, ConfigDict


class Frozen(BaseModel):
    """A model that does not change."""

    model_config = ConfigDict(frozen=True)


class Exact(BaseModel):
    """A model that does not change, and refuses fields that it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)
