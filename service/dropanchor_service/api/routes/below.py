"""Routes below a path."""

from collections.abc import Iterable
from copy import copy

from starlette.routing import BaseRoute, Route, WebSocketRoute, compile_path


def below(prefix: str, routes: Iterable[BaseRoute], documented: bool = True) -> list[BaseRoute]:
    """Return copies of the routes with `prefix` before their paths, which may name the site.

    FastAPI's `include_router` would make each of them again when the first request comes, which costs as much time as
    all else in a start. documented: whether the OpenAPI document has them.
    """
    return [_below(prefix, route, documented) for route in routes]


def _below(prefix: str, route: BaseRoute, documented: bool) -> BaseRoute:
    moved = copy(route)
    assert isinstance(moved, Route | WebSocketRoute)
    if isinstance(moved, Route):
        moved.include_in_schema = moved.include_in_schema and documented
    moved.path = prefix + moved.path
    moved.path_regex, moved.path_format, moved.param_convertors = compile_path(moved.path)
    return moved
