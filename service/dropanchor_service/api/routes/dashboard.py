"""The dashboard: static files that browsers always revalidate and that may load nothing from other origins."""

import os
from functools import lru_cache
from hashlib import sha256
from importlib.resources import files
from mimetypes import guess_type
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from pydantic import TypeAdapter
from starlette.datastructures import Headers
from starlette.middleware.gzip import GZipMiddleware
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Match, Mount, Route
from starlette.staticfiles import NotModifiedResponse, PathLike, StaticFiles
from starlette.types import ASGIApp, Scope

from dropanchor_schemas.site import TagSettings
from dropanchor_schemas.zones import EventRule
from dropanchor_service.api.help.routes import help_routes
from dropanchor_service.api.http.site_in_path import is_omlox
from dropanchor_service.api.routes.page_bundle import PROGRAMS, bundle, last_change

_HEADERS = {
    "cache-control": "no-cache",
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


class _Files(StaticFiles):
    """Files that stay in memory, and programs that are one file with all their modules."""

    def __init__(self, folder: Path, html: bool = False) -> None:
        super().__init__(directory=folder, html=html)
        self._folder = folder.resolve()

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        if isinstance(response, RedirectResponse):
            response = _to_folder(response)
        response.headers.update(_HEADERS)
        return response

    def file_response(
        self, full_path: PathLike, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        name = os.path.relpath(full_path, self._folder)
        if name in PROGRAMS:
            content, etag = _bundled(self._folder, name, last_change(self._folder))
        else:
            content, etag = _content(os.fspath(full_path), stat_result.st_mtime_ns)
        response = Response(content, status_code, {"etag": etag}, guess_type(full_path)[0] or "text/plain")
        is_known = self.is_not_modified(response.headers, Headers(scope=scope))
        return NotModifiedResponse(response.headers) if is_known else response


def _compressed(files: ASGIApp) -> ASGIApp:
    """Return files in a third of the bytes. They hold no secret that their size could tell, as answers of REST may."""
    return GZipMiddleware(files, compresslevel=6)


def _to_folder(response: RedirectResponse) -> Response:
    """Lead to the same folder as the redirect, from where the client sees it: a proxy may have it below a path."""
    to = urlsplit(response.headers["location"])
    folder = to.path.rstrip("/").rpartition("/")[2]
    return RedirectResponse(f"./{folder}/" + (f"?{to.query}" if to.query else ""))


@lru_cache(maxsize=512)
def _content(path: str, changed_ns: int) -> tuple[bytes, str]:  # noqa: ARG001 - a changed file is read again
    return _with_etag(Path(path).read_bytes())


@lru_cache(maxsize=32)
def _bundled(folder: Path, program: str, changed_ns: int) -> tuple[bytes, str]:  # noqa: ARG001 - as above
    return _with_etag(bundle(folder, program).encode())


def _with_etag(content: bytes) -> tuple[bytes, str]:
    return content, f'"{sha256(content).hexdigest()[:32]}"'


ELSEWHERE = {"/openapi.json": "api/v1/openapi.json", "/api/v1/docs": "../../docs/"}
"""Where people look for what is elsewhere, and where it is from there."""


def page_mounts(dashboard: Path) -> list[BaseRoute]:
    """Return the routes of the pages: documentation, that of REST, schemas, last the dashboard."""
    swagger_ui = _Files(Path(str(files("fastapi_swagger.resources"))))
    leading = [_leading(path, to) for path, to in ELSEWHERE.items()]
    of_rest = Mount("/docs/swagger-ui", app=_compressed(swagger_ui), name="swagger-ui")
    models = [_model("event_rule", TypeAdapter(EventRule)), _model("tag_settings", TypeAdapter(TagSettings))]
    return [*leading, *help_routes(), of_rest, *models, DashboardMount(dashboard)]


def _model(name: str, model: TypeAdapter[Any]) -> Route:
    """Return the route of the schema of a model, of which the page makes a form."""
    answer = JSONResponse(model.json_schema(), headers={"cache-control": "no-cache"})
    return Route(f"/schemas/{name}.json", answer, methods=["GET"], include_in_schema=False)


def _leading(path: str, to: str) -> Route:
    return Route(path, lambda _: RedirectResponse(to), include_in_schema=False)


class DashboardMount(Mount):
    """Serves the dashboard at the root. It leaves out the interfaces, so that they answer their own 404 and 405."""

    def __init__(self, folder: Path) -> None:
        """Serve the files in `folder`. Raises RuntimeError when it does not exist."""
        super().__init__("/", app=_compressed(_Files(folder, html=True)), name="dashboard")

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        path = scope["path"]
        if scope["type"] != "http" or path.startswith(("/api/", "/metrics")) or is_omlox(path):
            return Match.NONE, {}
        is_read = scope["method"] in ("GET", "HEAD")
        match, child_scope = super().matches(scope)
        return (match if is_read or match is Match.NONE else Match.PARTIAL), child_scope
