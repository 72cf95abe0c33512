"""Narrow requests of a share link of one tag or one group to these tags. `permissions` says which it may send."""

from collections.abc import Callable
from urllib.parse import parse_qsl, unquote, urlencode

from starlette.types import Scope

from dropanchor_service.api.http.site_in_path import divided
from dropanchor_service.security.identity import Limit

_PREFIX = "/api/v1/"
_OF_THE_SITE = {f"{_PREFIX}{name}" for name in ("access", "history", "site")}
_BY_GROUP = {f"{_PREFIX}{name}" for name in ("figures", "heat-map", "poses", "stream")}
_BY_TAG = {f"{_PREFIX}{name}" for name in ("figures", "heat-map", "poses", "stream", "tags", "tracks")}
_OF_ONE_TAG = f"{_PREFIX}tags/"

Members = Callable[[str | None, str], list[str]]
"""Returns the tags of a group of a site; None: of the only one."""


def narrowed(scope: Scope, limit: Limit, members: Members) -> bool:
    """Narrow the query of a request to the tags of a link. Return False when the link does not allow the request."""
    site, path = divided(scope["path"])
    if path in _OF_THE_SITE:
        return True
    if path.startswith(_OF_ONE_TAG):
        tag = unquote(path.removeprefix(_OF_ONE_TAG).split("/")[0])
        return tag == limit.tag if limit.group is None else tag in members(site, limit.group)
    if limit.group is not None and path in _BY_GROUP:
        _set_query(scope, "group", limit.group)
        return True
    if path not in _BY_TAG:
        return False
    tags = [str(limit.tag)] if limit.group is None else members(site, limit.group)
    if not tags:
        return False  # an empty list of tags would stand for all of them
    _set_query(scope, "tags", *(tags * 2 if len(tags) == 1 else tags))  # repeated, each value is one id
    return True


def _set_query(scope: Scope, name: str, *values: str) -> None:
    """Replace whatever the query says about this parameter."""
    query = parse_qsl(scope.get("query_string", b"").decode("latin-1"), keep_blank_values=True)
    others = [pair for pair in query if pair[0] != name]
    scope["query_string"] = urlencode(others + [(name, value) for value in values]).encode()
