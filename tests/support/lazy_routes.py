"""Make the routes of an application when they are used: hundreds of tests make one, and ask for a path or two of it."""

from collections.abc import Callable
from functools import cache
from threading import RLock
from typing import Any

from fastapi.routing import APIRoute
from starlette.routing import compile_path
from starlette.types import Receive, Scope, Send

from dropanchor_service.api.routes import sites

_make: Callable[..., None] = APIRoute.__init__
_describe_below_site = sites._describe  # it would ask each route for what it is
_becoming = RLock()


def make_routes_late() -> None:
    """Let each route of FastAPI read the parameters of its endpoint when a request or a document needs them.

    Until then it knows its path and its methods alone. What it then is, and what it answers, is what FastAPI makes of
    it: a wrong declaration fails in the tests of its path and in those of the document.
    """
    APIRoute.__init__ = _know_path  # type: ignore[method-assign]
    APIRoute.__getattr__ = _become_complete  # type: ignore[attr-defined]
    sites._describe = _describe_later


def _know_path(self: APIRoute, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
    @cache  # copies of this route, below other paths, share it
    def complete() -> APIRoute:
        route: APIRoute = object.__new__(type(self))
        _make(route, path, endpoint, **options)
        return route

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        await complete().app(scope, receive, send)

    self.path, self.endpoint, self.app = path, endpoint, answer
    self.path_regex, self.path_format, self.param_convertors = compile_path(path)
    self.methods = {method.upper() for method in options.get("methods") or ["GET"]}
    self.include_in_schema = options.get("include_in_schema", True)
    vars(self)["complete"] = complete


def _become_complete(self: APIRoute, name: str) -> Any:
    """Return an attribute that the route lacked, and give it all others."""
    with _becoming:
        if complete := vars(self).pop("complete", None):
            vars(self).update({key: value for key, value in vars(complete()).items() if key not in vars(self)})
            if vars(self).pop("is_below_site", False):
                _describe_below_site(self)
    if name not in vars(self):
        raise AttributeError(f"{type(self).__name__} has no attribute {name}")
    return vars(self)[name]


def _describe_later(route: APIRoute) -> None:
    vars(route)["is_below_site"] = True
