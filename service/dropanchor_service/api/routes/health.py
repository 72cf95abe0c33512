"""Health checks for supervisors, and metrics for Prometheus."""

from collections.abc import Callable, Sequence

from fastapi import APIRouter, Request
from prometheus_client import CollectorRegistry
from prometheus_client.exposition import choose_encoder
from starlette.responses import Response

from dropanchor_schemas.answers import Health
from dropanchor_schemas.sentences import phrase_of
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.contents import TEXT
from dropanchor_service.api.routes.parameters import NO_QUERY, json_response

Ready = Callable[[], tuple[bool, Sequence[str]]]
Impaired = Callable[[], Sequence[str]]


def health_router(ready: Ready, impaired: Impaired) -> APIRouter:
    router = Router(tags=["health"], dependencies=[NO_QUERY])

    @router.get(
        "/health/live",
        summary="Check whether the service responds",
        response_model=Health,
        responses=problems(Kind.INVALID_REQUEST),
    )
    async def get_live() -> Response:
        return json_response({"status": "live"})

    @router.get(
        "/health/ready",
        summary="Check whether the service can do its work",
        response_model=Health,
        responses=problems(Kind.INVALID_REQUEST, Kind.NOT_READY),
    )
    def get_ready() -> Response:
        ok, reasons = ready()
        if not ok:
            detail = reasons[0] if len(reasons) == 1 else "; ".join(reasons)
            raise ProblemError(Kind.NOT_READY, detail, reasons=list(reasons))
        found = list(impaired())
        return json_response({"status": "ready", "impaired": found, "impaired_phrases": list(map(phrase_of, found))})

    return router


def metrics_router(registry: CollectorRegistry) -> APIRouter:
    router = Router(tags=["health"])

    @router.get(
        "/metrics",
        summary="Get metrics for Prometheus",
        response_class=Response,
        responses={200: {"content": {"text/plain": TEXT}}},
    )
    def get_metrics(request: Request) -> Response:
        encode, content_type = choose_encoder(request.headers.get("accept", ""))
        return Response(encode(registry), headers={"content-type": content_type, "cache-control": "no-store"})

    return router
