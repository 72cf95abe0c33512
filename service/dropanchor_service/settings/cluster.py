"""The settings of a process that shares its sites with others, of which one serves them."""

import re
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from dropanchor_service.settings.ids import SettingsId


def _is_postgresql(url: str) -> str:
    if not url.startswith(("postgresql://", "postgres://")):
        raise ValueError("an address such as postgresql://dropanchor@db.example/dropanchor was expected")
    if re.match(r"[a-z]+://[^/@]*:[^/@]*@", url):
        raise ValueError("the password does not belong here: name its file with ?passfile=/path (libpq's .pgpass)")
    return url


class ClusterSettings(BaseModel):
    """Several processes with the same sites: one serves them, the others take over when it dies."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    url: Annotated[str, AfterValidator(_is_postgresql)] | None = Field(
        default=None,
        description="PostgreSQL database that says who serves the sites, and holds the checkpoint. It needs the extra "
        "`postgresql`. Not set: this process serves its sites alone.",
    )
    bucket: SettingsId | None = Field(
        default=None, description="Name of the sites of this process, equal in all processes that can serve them."
    )
    name: str | None = Field(default=None, description="Name of this process; not set: that of its machine.")
    address: Annotated[str, Field(pattern=r"^https?://[^\s#]+$")] | None = Field(
        default=None, description="Where clients reach this process. A standby tells them the address of the owner."
    )
    lease_s: Annotated[float, Field(ge=0.5, le=60)] = Field(
        default=2.0, description="Silence of the owner after which a standby takes over."
    )

    @model_validator(mode="after")
    def _url_and_bucket_belong_together(self) -> "ClusterSettings":
        if (self.url is None) != (self.bucket is None):
            raise ValueError("`url` and `bucket` belong together: set both or none")
        return self
