"""Find the site that a request is about: the one in its path, or the only one.

Routes know neither sites nor applications: `create_app` puts the sites into the state of the application.
"""

from collections.abc import Callable, Iterator, Sequence
from threading import Lock
from typing import Annotated, Any, Generic, TypeVar

from fastapi import Path
from fastapi.dependencies.utils import get_dependant
from starlette.requests import HTTPConnection

from dropanchor_schemas.site import ID_SCHEMA
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.http.errors import Kind, ProblemError
from dropanchor_service.api.routes.parameters import id_of
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.store.trail import Trail

SITE_PREFIX = "/sites/{site}"
T = TypeVar("T")


async def _describe_site(
    site: Annotated[
        str, Path(description="The site's id, percent-escaped.", examples=["default"], json_schema_extra=ID_SCHEMA)
    ],
) -> None:
    """Put the parameter into the interface document."""


SITE_IN_PATH = get_dependant(path=SITE_PREFIX, call=_describe_site)


class SitesOfApp:
    """What the routes of each site of an application work on."""

    def __init__(self, parts: Sequence[SiteParts]) -> None:
        self._parts = {one.id: one for one in parts}
        self.only = parts[0] if len(parts) == 1 else None
        self._kept: dict[tuple[object, str], Any] = {}
        self._lock = Lock()

    def __len__(self) -> int:
        return len(self._parts)

    def __iter__(self) -> Iterator[SiteParts]:
        return iter(self._parts.values())

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

    def kept(self, make: Callable[[SiteParts], T], parts: SiteParts) -> T:
        """Return what `make` has made of a site: it is called once."""
        with self._lock:
            if (make, parts.id) not in self._kept:
                self._kept[make, parts.id] = make(parts)
            made: T = self._kept[make, parts.id]
            return made

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


def sites_of(connection: HTTPConnection) -> SitesOfApp:
    """Return all sites of the application that a request came to."""
    sites: SitesOfApp = connection.app.state.sites
    return sites


def parts_of(connection: HTTPConnection) -> SiteParts:
    """Return what the routes of the site of a request work on. Raises ProblemError; see `SitesOfApp.parts`."""
    return sites_of(connection).parts(connection)


def answers_of(connection: HTTPConnection) -> Answers:
    """Raises ProblemError; see `SitesOfApp.parts`."""
    return parts_of(connection).answers


def trail_of(connection: HTTPConnection) -> Trail:
    """Return the trail of the site of a request, in which its routes note their changes. Raises ProblemError."""
    return parts_of(connection).events.trail


class ForEachSite(Generic[T]):
    """What a route keeps for each site, made when the first request needs it."""

    def __init__(self, make: Callable[[SiteParts], T]) -> None:
        self._make = make

    def __call__(self, connection: HTTPConnection) -> T:
        """Return that of the site of a request. Raises ProblemError; see `SitesOfApp.parts`."""
        return sites_of(connection).kept(self._make, parts_of(connection))
