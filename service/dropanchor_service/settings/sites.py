"""The settings of each of several sites in one process."""

from typing import Annotated, Literal

from pydantic import Field

from dropanchor_schemas.models import Exact
from dropanchor_schemas.site import Site, TagSettings
from dropanchor_service.settings.ids import SettingsId
from dropanchor_service.settings.quota import Quota, UnknownTags

ScopeName = Literal["read", "write", "admin"]


class SiteSettings(Exact):
    """One of several sites. What is not set is as at the top level."""

    unknown_tags: UnknownTags | None = Field(default=None, description="`unknown_tags` of this site.")
    max_unconfirmed_tags: Annotated[int, Field(ge=0, le=1_000_000)] | None = Field(
        default=None, description="`max_unconfirmed_tags` of this site."
    )
    max_tags: Annotated[int, Field(ge=1, le=1_000_000)] | None = Field(
        default=None, description="`max_tags` of this site."
    )
    site: Site = Field(default=Site(), description="The frame and the anchors of this site, without `id`.")
    tags: dict[SettingsId, TagSettings] = Field(default={}, description="A tag of this site.")
    tag_defaults: TagSettings = Field(default=TagSettings(), description="What every tag of this site gets.")

    oidc_scopes: dict[ScopeName, str] = Field(
        default={},
        description="The OpenID Connect provider's names of our scopes in this site alone. Those of `security.oidc` "
        "hold in every site.",
    )

    def require_fit(self, name: str, default: Quota) -> None:
        """Raise ValueError if the table contradicts its name or its quota. default: the quota at the top level."""
        if "id" in self.site.model_fields_set and self.site.id != name:
            raise ValueError(f"[sites.{name}] has the id {self.site.id!r}: leave out `id`, which is {name!r}")
        max_tags = self.quota(default).max_tags
        if len(self.tags) > max_tags:
            raise ValueError(f"max_tags of the site {name!r} is {max_tags}, but {len(self.tags)} tags are listed")

    def quota(self, default: Quota) -> Quota:
        """Return which tags the site admits. default: where its table says nothing."""
        given = {name: getattr(self, name) for name in ("unknown_tags", "max_unconfirmed_tags", "max_tags")}
        return Quota(**(vars(default) | {name: value for name, value in given.items() if value is not None}))
