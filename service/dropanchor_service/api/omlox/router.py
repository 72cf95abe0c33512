"""All routes of the omlox interface, on the stores of the service."""

from functools import cache
from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import Response
from starlette.routing import BaseRoute

from dropanchor_service.api.http.router import Router
from dropanchor_service.api.http.site_in_path import OMLOX_PREFIX
from dropanchor_service.api.omlox.document import document_of
from dropanchor_service.api.omlox.feed import socket
from dropanchor_service.api.omlox.routes import fences, providers, trackables, zones
from dropanchor_service.api.routes.below import below
from dropanchor_service.api.routes.parameters import json_response
from dropanchor_service.api.routes.site_of_request import SITE_PREFIX

VERSIONS = ("v2", "v1")
"""Older clients use v1, of which this is a part, too."""


@cache
def omlox_routes(has_one_site: bool) -> tuple[BaseRoute, ...]:
    """Return the interface, with a document of its own: of each site below its id, and of an only one."""
    described = described_routes()
    found: list[BaseRoute] = []
    for version in VERSIONS:
        path = f"{OMLOX_PREFIX}{version}"
        for prefix in (SITE_PREFIX + path, *([path] if has_one_site else [])):
            for router in (described, socket.router, _document_router(described)):
                found += below(prefix, router.routes, documented=False)
    return tuple(found)


def described_routes() -> APIRouter:
    """Return the routes that the document describes."""
    router = Router()
    for part in (trackables, providers, zones, fences):
        router.routes.extend(part.router.routes)
    return router


def _document_router(described: APIRouter) -> APIRouter:
    router = Router()

    @cache
    def document() -> dict[str, Any]:
        return document_of(described, "")

    @router.get("/openapi.json")
    def get_document(request: Request) -> Response:
        url = request.scope["path"].removesuffix("/openapi.json")
        return json_response(document() | {"servers": [{"url": url}]})

    return router
