"""The routes of share links."""

from collections.abc import Sequence
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import Body, Path, Request
from starlette.responses import Response

from dropanchor_schemas.sentences import say
from dropanchor_schemas.shares import NewShare, Share, ShareList, ShareRequest
from dropanchor_service.api.http.behind_proxy import prefix_of
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response, saving
from dropanchor_service.api.routes.shared_parts import shared_of
from dropanchor_service.api.routes.site_of_request import parts_of, sites_of, trail_of
from dropanchor_service.security.share_links import MAX_LINKS, ShareLinks, TooManyLinksError, share_links_of
from dropanchor_service.store.trail import Change

_EXAMPLE: dict[str, Any] = {
    "id": "3f9a1c5e7b20d846",
    "name": "Visitors",
    "made_ns": 1_800_000_000_000_000_000,
    "expires_ns": 1_800_604_800_000_000_000,
    "tag": None,
    "group": "forklifts",
    "site": "default",
}
_SECRET = "dropanchor_share_eyJhbGciOi.eyJqdGkiOi.c2lnbmF0dXJl"
_DESCRIPTION = """\
The link shows the page, read only, until it expires or is revoked, and its `secret` works as a bearer token with the
scope `read`. A link of a tag or a group reads these tags, the site and nothing else. The service signs links with a key
in its data folder."""


router = Router(tags=["shares"], dependencies=[NO_QUERY])


@router.get(
    "/shares",
    summary="List the share links",
    response_model=ShareList,
    responses=example_response({"available": True, "shares": [_EXAMPLE]}) | problems(Kind.INVALID_REQUEST),
)
async def list_shares(request: Request) -> Response:
    site, links = parts_of(request).id, _links_of(request)
    shares: Sequence[Share] = [] if links is None else links.of_site(site)
    available = links is not None and links.can_change
    return json_response({"available": available, "shares": [share.model_dump() for share in shares]})


@router.post(
    "/shares",
    summary="Create a share link",
    description=_DESCRIPTION,
    status_code=201,
    response_model=NewShare,
    responses=example_response(_EXAMPLE | {"secret": _SECRET, "path": f"/#group=forklifts&share={_SECRET}"}, 201)
    | problems(Kind.NO_ACCESS_CONTROL, Kind.ITEMS_FULL, Kind.INVALID_REQUEST, Kind.BODY_TOO_LARGE, Kind.NOT_SAVED),
)
def create_share(body: Annotated[ShareRequest, Body(examples=[{"name": "Visitors"}])], request: Request) -> Response:
    site, links = parts_of(request).id, _links_of(request)
    if links is None:
        raise _no_access_control()
    try:
        with saving(), trail_of(request).changing(Change("share", "", None, None)) as change:
            share, secret = links.add(site, body)
            change.item, change.after = share.id, share
    except TooManyLinksError as error:
        raise ProblemError(
            Kind.ITEMS_FULL, say("shares_full", "There are {n} share links: revoke some.", n=MAX_LINKS)
        ) from error
    page = prefix_of(request) + ("/" if sites_of(request).only else f"/?site={quote(site, safe='')}")
    view = f"{body.view}&" if body.view else ""
    return json_response(share.model_dump() | {"secret": secret, "path": f"{page}#{view}share={secret}"}, status=201)


def _links_of(request: Request) -> ShareLinks | None:
    """Return the links; None without access control, with which everybody sees everything anyway."""
    return share_links_of(shared_of(request).authenticator)


def _no_access_control() -> ProblemError:
    return ProblemError(
        Kind.NO_ACCESS_CONTROL,
        say(
            "no_access_control",
            "Without access control everybody sees everything: send the address of the page. To share "
            "less, set `security.folder` and `data_dir`.",
        ),
    )


@router.delete(
    "/shares/{share}",
    summary="Revoke a share link, which ends its streams",
    status_code=204,
    responses=problems(Kind.UNKNOWN_SHARE, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
)
def revoke_share(
    share: Annotated[str, Path(description="The id of the link.", examples=[_EXAMPLE["id"]])], request: Request
) -> None:
    site, links = parts_of(request).id, _links_of(request)
    known = None if links is None else next((one for one in links.of_site(site) if one.id == share), None)
    with saving(), trail_of(request).changing(Change("share", share, known, None)):
        if links is None or not links.revoke(site, share):
            raise ProblemError(
                Kind.UNKNOWN_SHARE,
                say("share_unknown", "There is no such share link. GET /api/v1/shares lists them."),
            )
