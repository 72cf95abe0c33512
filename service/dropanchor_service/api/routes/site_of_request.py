"""Find the site that a request is about: the one in its path, or the only one."""

from collections.abc import Callable, Iterator, Sequence
from threading import Lock
from typing import Annotated, Generic, TypeVar

from fastapi import Path
from fastapi.dependencies.utils import get_dependant
from starlette.requests import HTTPConnection

from dropanchor_schemas.site import ID_SCHEMA
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.routes.parameters import id_of
from dropanchor_service.api.routes.site_parts import SiteParts

SITE_PREFIX = "/sites/{site}"
T = TypeVar("T")


async def _describe_site(
    site: Annotated[
        str, Path(description="The site's id, percent-escaped.", examples=["default"], json_schema_extra=ID_SCHEMA)
    ],
) -> None:
    """Put the parameter into the interface document."""


SITE_IN_PATH = get_dependant(path=SITE_PREFIX, call=_describe_site)


class SiteOfRequest:
    """Returns the answers of the site that a request is about, or with `parts` all that its routes work on."""

    def __init__(self, parts: Sequence[SiteParts]) -> None:
        self._parts = {one.id: one for one in parts}
        self.only = parts[0] if len(parts) == 1 else None

    def __len__(self) -> int:
        return len(self._parts)

    def __iter__(self) -> Iterator[SiteParts]:
        return iter(self._parts.values())

    def __call__(self, connection: HTTPConnection) -> Answers:
        """Raises ProblemError; see `parts`."""
        return self.parts(connection).answers

    def parts(self, connection: HTTPConnection) -> SiteParts:
        """Return the parts of the site in the path, or of that of a tag's key, or of the only one.

        Raises ProblemError for an unknown site, and where nothing names one of several.
        """
        escaped = connection.path_params.get("site")
        name = getattr(connection.state, "site", None) if escaped is None else id_of(escaped)
        if name is None:
            return self._only()
        found = self._parts.get(name)
        if found is None:
            raise ProblemError(Kind.UNKNOWN_SITE, f"There is no site {name!r}. /api/v1/sites lists the sites.")
        return found

    def members(self, site: str | None, group: str) -> list[str]:
        """Return the tags of a group of a site; None: of the only one."""
        found = self.only if site is None else self.of_site(site)
        return [] if found is None else found.answers.tags_in_group(group)

    def of_site(self, site: str) -> SiteParts | None:
        """Return the parts of the site with this id, or None."""
        return self._parts.get(site)

    def _only(self) -> SiteParts:
        if self.only is None:
            raise ProblemError(
                Kind.SEVERAL_SITES,
                f"This service has {len(self)} sites: name one, as in /api/v1/sites/SITE/poses. /api/v1/sites "
                "lists the sites.",
            )
        return self.only


class ForEachSite(Generic[T]):
    """What a route keeps for each site, made when the first request needs it."""

    def __init__(self, site_of: SiteOfRequest, make: Callable[[SiteParts], T]) -> None:
        self._site_of = site_of
        self._make = make
        self._made: dict[str, T] = {}
        self._lock = Lock()

    def __call__(self, connection: HTTPConnection) -> T:
        """Return that of the site of a request. Raises ProblemError; see `SiteOfRequest.parts`."""
        parts = self._site_of.parts(connection)
        with self._lock:
            if parts.id not in self._made:
                self._made[parts.id] = self._make(parts)
            return self._made[parts.id]
