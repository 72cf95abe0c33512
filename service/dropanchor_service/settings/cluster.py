"""The settings of a process that shares its sites with others, of which one serves them."""

import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from dropanchor_schemas.models import Exact
from dropanchor_service.settings.ids import SettingsId


def _is_postgresql(url: str) -> str:
    if not url.startswith(("postgresql://", "postgres://")):
        raise ValueError("an address such as postgresql://dropanchor@db.example/dropanchor was expected")
    if re.match(r"[a-z]+://[^/@]*:[^/@]*@", url):
        raise ValueError("the password does not belong here: name its file with ?passfile=/path (libpq's .pgpass)")
    return url


class ClusterSettings(Exact):
    """Several processes with the same sites: one serves them, the others take over when it dies."""

    url: Annotated[str, AfterValidator(_is_postgresql)] | None = Field(
        default=None,
        description="PostgreSQL database that says who serves the sites, and holds the checkpoint. It needs the extra "
        "`postgresql`. Not set: this process serves its sites alone.",
    )
    bucket: SettingsId | None = Field(
        default=None,
        description="Name of the sites of this process, equal in all processes that can serve them. If the ids of "
        "sites begin with a bucket, such as `017.yard`: the bucket that this process serves.",
    )
    name: str | None = Field(default=None, description="Name of this process; not set: that of its machine.")
    address: Annotated[str, Field(pattern=r"^https?://[^\s#]+$")] | None = Field(
        default=None, description="Where clients reach this process. A standby tells them the address of the owner."
    )
    checkpoints: Annotated[str, Field(pattern=r"^[a-z0-9]+://[^@\s]+$")] | None = Field(
        default=None,
        description="Folder for the checkpoints that all processes reach, such as `s3://bucket/dropanchor` or "
        "`file:///mnt/share/dropanchor`. It needs the extra `s3`, also for `file`. Address and credentials of a store "
        "are those of its own settings, such as `AWS_ENDPOINT_URL`. Not set: the database holds them.",
    )
    node_secret: Path | None = Field(
        default=None,
        description="File with a secret that the nodes of `dropanchor api` show to the services. Only whoever shows it "
        "is believed about the address of a client.",
    )
    lease_s: Annotated[float, Field(ge=0.5, le=60)] = Field(
        default=2.0, description="Silence of the owner after which a standby takes over."
    )

    @model_validator(mode="after")
    def _a_bucket_needs_a_url(self) -> "ClusterSettings":
        for name in ("bucket", "checkpoints"):
            if self.url is None and getattr(self, name) is not None:
                raise ValueError(f"`{name}` is of a cluster: set `url`, too")
        return self
