"""The OpenAPI document of the omlox interface: of what this service offers, in its own words."""

from typing import Any

from fastapi import APIRouter
from fastapi.openapi.utils import get_openapi

from dropanchor_service.api.omlox.models import Feature, FeatureCollection, FenceEvent, OmloxProblem

_DESCRIPTION = """\
The subset of the omlox Hub API that clients use to read where things are, on the same data as `/api/v1`. Tags are
location providers, anchors are zones, zones are fences. A tag has a location only while its place is known.

Errors are problem documents (RFC 9457) that also have `code` and `message`. WebSockets are outside OpenAPI: the path
is `/ws/socket`."""


def document_of(router: APIRouter, url: str) -> dict[str, Any]:
    """Return the document of these routes. url: the path in front of them."""
    document = get_openapi(
        title="Dropanchor: omlox interface",
        version="2",
        description=_DESCRIPTION,
        routes=router.routes,
        servers=[{"url": url}],
    )
    schemas = document["components"]["schemas"]
    for model in (OmloxProblem, FenceEvent, Feature, FeatureCollection):
        schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
        schemas |= schema.pop("$defs", {}) | {model.__name__: schema}
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    document["components"]["securitySchemes"] = {"bearer": {"type": "http", "scheme": "bearer"}}
    document["security"] = [{"bearer": []}, {}]
    for operations in document["paths"].values():
        for operation in operations.values():
            answered = sorted(set(operation["responses"]) - {"422"})  # this interface answers 400 instead
            operation["responses"] = {status: operation["responses"][status] for status in answered}
    return document
