"""Find the hub of the site that a request is about."""

from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.routes.site_of_request import ForEachSite
from dropanchor_service.api.routes.site_parts import SiteParts


def _hub_of_site(parts: SiteParts) -> Hub:
    assert parts.omlox is not None
    return Hub(parts.answers, parts.events.items.zones, parts.events.store, parts.omlox, parts.max_tags)


def hub_of(connection: HTTPConnection) -> Hub:
    """Raises ProblemError; see `SitesOfApp.parts`."""
    return ForEachSite(_hub_of_site)(connection)


async def _hub_of_request(connection: HTTPConnection) -> Hub:
    return hub_of(connection)


SiteHub = Annotated[Hub, Depends(_hub_of_request)]
"""The hub of the site in the path, or of the only one."""
