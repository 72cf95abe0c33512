"""Puts the interface together. Everything it uses is passed in."""

from pathlib import Path
from threading import Event
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from prometheus_client import CollectorRegistry

from dropanchor_schemas.answers import PoseFrame, Problem
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.http.access import OPEN, Access
from dropanchor_service.api.http.errors import Kind, add_error_handlers, problems
from dropanchor_service.api.http.headers import SecurityHeaders
from dropanchor_service.api.http.limits import BodyLimit, EscapedPath
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.connect import connect_router
from dropanchor_service.api.routes.dashboard import DashboardMount
from dropanchor_service.api.routes.health import Impaired, Ready, health_router, metrics_router
from dropanchor_service.api.routes.poses import poses_router
from dropanchor_service.api.routes.recordings import recordings_router
from dropanchor_service.api.routes.site import site_router
from dropanchor_service.api.routes.stream import stream_router
from dropanchor_service.api.routes.tags import tags_router
from dropanchor_service.api.routes.track import track_router
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.security.identity import Authenticator

PREFIX = "/api/v1"
MAX_BODY_BYTES = 1_048_576
DASHBOARD = Path(__file__).parent.parent / "dashboard"


def create_app(
    answers: Answers,
    *,
    ready: Ready,
    registry: CollectorRegistry,
    stopping: Event,
    impaired: Impaired = list,
    recorder: Recorder | None = None,
    max_tags: int = 20_000,
    dashboard: Path | None = DASHBOARD,
    endpoints: tuple[str, ...] = (),
    credentials: SecurityFolder | None = None,
    authenticator: Authenticator | None = None,
    rate_limiter: RateLimiter | None = None,
) -> FastAPI:
    """ready: whether the service can do its work, and why not. impaired: what else does not work. stopping: when set,
    streams end. recorder: None where nothing can be recorded. dashboard: the folder of the page, None for no page.
    endpoints: of the Zenoh router, as they are set. credentials: what tags need, None where they need none.
    authenticator: who knows who asks; None: everybody may do everything. rate_limiter: how often one client may ask."""
    app = FastAPI(
        title="Dropanchor",
        version="1",
        openapi_url=f"{PREFIX}/openapi.json",
        docs_url=None,  # its scripts come from elsewhere; the page works without any other network
        redoc_url=None,
        redirect_slashes=False,
    )
    app.add_middleware(BodyLimit, max_bytes=MAX_BODY_BYTES)
    app.add_middleware(Access, authenticator=authenticator, rate_limiter=rate_limiter)
    app.add_middleware(EscapedPath)
    app.add_middleware(SecurityHeaders)
    add_error_handlers(app)
    for router in (
        poses_router(answers),
        tags_router(answers, max_tags),
        track_router(answers),
        stream_router(answers, stopping),
        site_router(answers.site),
        connect_router(answers.site, endpoints, credentials),
        recordings_router(recorder),
        health_router(ready, impaired),
    ):
        app.include_router(router, prefix=PREFIX)
    app.include_router(metrics_router(registry))
    if dashboard is not None:
        app.router.routes.append(DashboardMount(dashboard))
    app.openapi = lambda: openapi_of(app)  # type: ignore[method-assign]
    return app


def openapi_of(app: FastAPI) -> dict[str, Any]:
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title, version=app.version, description=_description(), routes=app.routes, tags=_TAGS
        )
        for model in (PoseFrame, Problem):  # neither is the one model of a route
            schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
            document["components"]["schemas"] |= schema.pop("$defs") | {model.__name__: schema}
        _add_access(document)
        app.openapi_schema = document
    return app.openapi_schema


def _add_access(document: dict[str, Any]) -> None:
    """How somebody is known, and what is answered otherwise, at every operation that asks."""
    document["components"]["securitySchemes"] = {
        "bearer": {"type": "http", "scheme": "bearer", "description": "An API key, or a token of the site's provider."}
    }
    refusals = {str(status): told for status, told in problems(*_REFUSALS).items()}
    for path, operations in document["paths"].items():
        for operation in operations.values() if path not in OPEN else ():
            operation["responses"] = dict(sorted((operation["responses"] | refusals).items()))
            operation["security"] = [{"bearer": []}, {}]


_REFUSALS = (Kind.UNAUTHENTICATED, Kind.FORBIDDEN, Kind.TOO_MANY_REQUESTS)
_TAGS = [
    {"name": "poses", "description": "Where the tags are."},
    {"name": "tags", "description": "What was heard from the tags, and what an operator knows about them."},
    {"name": "site", "description": "The frame, its place on the Earth, and the anchors."},
    {"name": "recordings", "description": "Raw samples and poses in MCAP files."},
    {"name": "health", "description": "For supervisors and Prometheus."},
]


def _description() -> str:
    rows = "\n".join(f"| `{kind.type}` | {kind.status} | {kind.title} |" for kind in Kind)
    return (
        "Live positions of a fleet of tags around one dropped UWB anchor. SI units; the site frame is ENU with x east; "
        "times are UTC in ns.\n\nErrors are problems (RFC 9457) of these types:\n\n"
        f"| type | status | title |\n|---|---|---|\n{rows}\n"
    )
