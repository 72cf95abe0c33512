"""The page of who may do what, from the routes of the application and the table that its access control asks."""

from collections.abc import Iterator

from fastapi import FastAPI
from fastapi.routing import iter_route_contexts
from starlette.routing import WebSocketRoute

from dropanchor_evaluation.reference.markdown import table
from dropanchor_service.api.http.permissions import Need, need_of
from dropanchor_service.api.http.site_in_path import divided

SOCKET = "WebSocket"
_OLDER = "/omlox/v1/"  # the same as v2
HOLDERS = {
    "none": Need.NOTHING,
    "key of a tag": Need.TAG,
    "link to tags": Need.LINK_TO_TAGS,
    "link": Need.LINK,
    "`read`": Need.READ,
    "`write`": Need.WRITE,
    "`admin`": Need.ADMIN,
}
"""The columns of the table, and what each credential has."""

_INTRODUCTION = """\
# Who may do what

With [credentials](../how-to/secure-a-site.md), each request needs one of these. *None*: no credentials. *Key of a tag*:
made with `--tag`; it speaks for its tag alone. *Link to tags*: a share link of a tag or a group; every answer is
narrowed to these tags. *Link*: a share link of the whole site. `read`, `write` and `admin`: an API key or a token with
this scope.

The service asks this very table. A path also stands for the one with its site before it, and `/omlox/v2` for
`/omlox/v1`; a key, token or link of one site has nothing in another. The files of the page need nothing: they hold no
data of the site.

Links read of a tag's status neither health nor remote settings, and of its settings only `name`, `colour` and `group`,
those of the whole site also `height_m`. No answer holds a secret, for administrators neither: a key or a share link is
shown once, when it is made, the secret of a webhook never, and its URL up to the host. The experiment of phyphox holds
the key that asked for it. In the trail of changes (`/audit`), entries of keys and share links are for `admin` alone.

"""


def page(app: FastAPI) -> str:
    """Return the page as Markdown. app: of an only site, with all its interfaces."""
    rows = [(f"`{method} {path}`", *_marks(need)) for method, path, need in operations_of(app)]
    return _INTRODUCTION + table(("request", *HOLDERS), rows)


def operations_of(app: FastAPI) -> list[tuple[str, str, Need]]:
    """Return the method and the path of every route, without the site, and what it needs."""
    found = dict.fromkeys(_operations(app))
    return [(method, path, need_of("GET" if method == SOCKET else method, path)) for method, path in found]


def allows(has: Need, need: Need) -> bool:
    """Return whether a credential is enough for a request."""
    return need is Need.NOTHING or (has is need if Need.TAG in (has, need) else has >= need)


def _operations(app: FastAPI) -> Iterator[tuple[str, str]]:
    for context in iter_route_contexts(app.routes):
        path = context.path
        if path is None or divided(path)[0] is not None or path.startswith(_OLDER):
            continue
        if isinstance(context.original_route, WebSocketRoute):
            yield SOCKET, path
        for method in sorted(set(context.methods or ()) - {"HEAD"}):
            yield method, path


def _marks(need: Need) -> list[str]:
    return ["✓" if allows(has, need) else "" for has in HOLDERS.values()]
