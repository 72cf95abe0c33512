"""All routes of the omlox interface, on the stores of the service."""

from collections.abc import Sequence
from functools import cache
from threading import Event

from fastapi import APIRouter, Depends, FastAPI
from starlette.responses import Response

from dropanchor_service.answers.answers import to_json
from dropanchor_service.api.http.errors import OMLOX_PREFIX
from dropanchor_service.api.omlox.document import document_of
from dropanchor_service.api.omlox.feed.socket import Doorkeeper, feed_router
from dropanchor_service.api.omlox.hub import Hub
from dropanchor_service.api.omlox.parameters import refuse_pages
from dropanchor_service.api.omlox.routes.fences import fences_router
from dropanchor_service.api.omlox.routes.providers import providers_router
from dropanchor_service.api.omlox.routes.trackables import trackables_router
from dropanchor_service.api.omlox.routes.zones import zones_router

VERSIONS = ("v2", "v1")
"""Older clients use v1, of which this is a part, too."""


def add_omlox(app: FastAPI, hub: Hub, doorkeeper: Doorkeeper, stopping: Event) -> None:
    """Add the interface to the application, with a document of its own. stopping: ends the WebSockets when set."""
    described, feed = described_routes(hub, doorkeeper.origins), feed_router(hub, doorkeeper, stopping)
    for version in VERSIONS:
        prefix = f"{OMLOX_PREFIX}{version}"
        for router in (described, feed, _document_router(described, prefix)):
            app.include_router(router, prefix=prefix, include_in_schema=False)


def described_routes(hub: Hub, origins: Sequence[str] = ()) -> APIRouter:
    """Return the routes that the document describes. origins: of web pages that may change something."""
    router = APIRouter(dependencies=[Depends(refuse_pages(origins))])
    for part in (trackables_router(hub), providers_router(hub), zones_router(hub), fences_router(hub)):
        router.include_router(part)
    return router


def _document_router(described: APIRouter, prefix: str) -> APIRouter:
    router = APIRouter()

    @cache
    def document() -> bytes:
        return to_json(document_of(described, prefix))

    @router.get("/openapi.json")
    def get_document() -> Response:
        return Response(document(), media_type="application/json")

    return router
