"""Find the site that a request is about: the one in its path, or the only one."""

from typing import Annotated

from fastapi import Depends, Path, Request

from dropanchor_schemas.site import ID_SCHEMA
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.of_sites import AnswersOfSites
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.routes.parameters import id_of

SITE_PREFIX = "/sites/{site}"


async def _describe_site(
    site: Annotated[
        str, Path(description="The site's id, percent-escaped.", examples=["default"], json_schema_extra=ID_SCHEMA)
    ],
) -> None:
    """Put the parameter into the interface document."""


SITE_IN_PATH = Depends(_describe_site)


class SiteOfRequest:
    """Returns the answers of the site that a request is about."""

    def __init__(self, sites: AnswersOfSites) -> None:
        self.sites = sites

    def __call__(self, request: Request) -> Answers:
        """Raises ProblemError for an unknown site, and without a site in the path when there are several."""
        escaped = request.path_params.get("site")
        if escaped is None:
            return self._only()
        name = id_of(escaped)
        found = self.sites.find(name)
        if found is None:
            raise ProblemError(Kind.UNKNOWN_SITE, f"There is no site {name!r}. /api/v1/sites lists the sites.")
        return found

    def _only(self) -> Answers:
        if self.sites.only is None:
            raise ProblemError(
                Kind.SEVERAL_SITES,
                f"This service has {len(self.sites)} sites: name one, as in /api/v1/sites/SITE/poses. /api/v1/sites "
                "lists the sites.",
            )
        return self.sites.only
