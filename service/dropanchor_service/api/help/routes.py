"""The routes of the documentation. Like the page itself it holds no data of the site, so it needs no credentials."""

from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Route

from dropanchor_service.api.help.documents import START
from dropanchor_service.api.help.rendering import page
from dropanchor_service.api.help.search import results

_HEADERS = {
    "cache-control": "no-cache",
    "content-security-policy": "default-src 'none'; style-src 'self'; img-src 'self'; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'none'",
}


def help_routes() -> list[BaseRoute]:
    """Return the routes below `/help`. Paths are those of the files, so links between the files need no change."""
    return [
        Route("/help", lambda _: RedirectResponse("help/"), include_in_schema=False),
        Route("/help/{path:path}", _answer, include_in_schema=False),
    ]


def _answer(request: Request) -> Response:
    """Answer with a page, or with what was searched. It runs in a thread of its own, beside the event loop."""
    path = request.path_params["path"] or START
    asked = request.query_params.get("q", "")[:100].strip()
    if path == START and asked:
        return HTMLResponse(results(asked), headers=_HEADERS)
    try:
        return HTMLResponse(page(path), headers=_HEADERS)
    except KeyError:
        return PlainTextResponse("The documentation has no such page.", 404)
