"""The routes for API keys, with which administrators of a site let people, programs and phones in.

A key of an administrator is made with the command alone, and is not even listed: whoever administers the machine
decides who administers the site.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from typing import Annotated, Any

from fastapi import Body, Path, Request
from starlette.responses import Response

from dropanchor_schemas.api_keys import AccessKey, AccessKeyList, KeyRequest, NewAccessKey
from dropanchor_schemas.sentences import said_by, say
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response, saving
from dropanchor_service.api.routes.shared_parts import shared_of
from dropanchor_service.api.routes.site_of_request import parts_of, sites_of, trail_of
from dropanchor_service.security.api_keys import ApiKey, ApiKeyError, ApiKeys, api_keys_of
from dropanchor_service.security.identity import Scope
from dropanchor_service.store.trail import Change

_EXAMPLE: dict[str, Any] = {
    "id": "3f9a1c5e",
    "name": "Early shift",
    "scope": "write",
    "tag": None,
    "made_ns": 1_800_000_000_000_000_000,
    "expires_ns": 1_807_776_000_000_000_000,
}
_SECRET = "dropanchor_3f9a1c5e_c2VjcmV0LW9mLXRoZS1rZXk"
_DESCRIPTION = """\
The key works in this site alone, until it expires or is revoked. Its `secret` is shown once: the service keeps its
hash. A key with a tag sends the samples of that tag and does nothing else; the page `/tag/` makes a phone that tag."""


router = Router(tags=["keys"], dependencies=[NO_QUERY])


@router.get(
    "/keys",
    summary="List the API keys of the site, but for those of administrators",
    response_model=AccessKeyList,
    responses=example_response({"available": True, "keys": [_EXAMPLE]}) | problems(Kind.INVALID_REQUEST),
)
def list_keys(request: Request) -> Response:
    keys = _all_keys(request)
    found = sorted(_keys_of(request, keys).items(), key=lambda entry: entry[1].made)
    listed = [_shown(identifier, key).model_dump() for identifier, key in found]
    return json_response({"available": keys is not None and keys.can_change, "keys": listed})


@router.post(
    "/keys",
    summary="Create an API key for reading, writing, or a tag",
    description=_DESCRIPTION,
    status_code=201,
    response_model=NewAccessKey,
    responses=example_response(_EXAMPLE | {"secret": _SECRET}, 201)
    | problems(Kind.NO_ACCESS_CONTROL, Kind.EXISTS_ALREADY, Kind.INVALID_REQUEST, Kind.BODY_TOO_LARGE, Kind.NOT_SAVED),
)
def create_key(
    body: Annotated[KeyRequest, Body(examples=[{"name": "Early shift", "scope": "write"}])], request: Request
) -> Response:
    site, keys = parts_of(request).id, _all_keys(request)
    if keys is None:
        raise ProblemError(Kind.NO_ACCESS_CONTROL, say("key_free", "Without access control nobody needs a key."))
    if any(key.name == body.name for key in keys.all().values()):
        raise ProblemError(
            Kind.EXISTS_ALREADY,
            say("key_taken", "There is a key named {name} already: choose another name.", name=repr(body.name)),
        )
    with _changing(keys), trail_of(request).changing(Change("key", body.name, None, body)) as change:
        secret = _made(keys, body, site)
        identifier = secret.split("_")[1]
        change.after = shown = _shown(identifier, keys.all()[identifier])
    return json_response(shown.model_dump() | {"secret": secret}, status=201)


@router.delete(
    "/keys/{key}",
    summary="Revoke an API key, which ends its streams",
    status_code=204,
    responses=problems(Kind.UNKNOWN_KEY, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
)
def revoke_key(
    key: Annotated[str, Path(description="The id of the key.", examples=[_EXAMPLE["id"]])], request: Request
) -> None:
    keys = _all_keys(request)
    unknown = ProblemError(Kind.UNKNOWN_KEY, say("no_such_key", "There is no such key. GET /api/v1/keys lists them."))
    known = _keys_of(request, keys).get(key)
    if keys is None or known is None:
        raise unknown
    with _changing(keys), trail_of(request).changing(Change("key", known.name, _shown(key, known), None)):
        if not keys.revoke_id(key):
            raise unknown


def _made(keys: ApiKeys, body: KeyRequest, site: str) -> str:
    """Make a key and return its secret. Raises ApiKeyError."""
    if body.tag is not None:
        return keys.add_for_tag(body.name, body.tag, body.days, site)
    return keys.add(body.name, Scope.named(body.scope or "read"), body.days, site)


@contextmanager
def _changing(keys: ApiKeys) -> Iterator[None]:
    """Turn a change of the keys that cannot be made into a problem. Then nothing has changed."""
    if not keys.can_change:
        raise ProblemError(
            Kind.NOT_SAVED,
            say(
                "key_by_command",
                "This service may not change its keys. Make and revoke them with `dropanchor key`, where its "
                "credentials were made.",
            ),
        )
    try:
        with saving():
            yield
    except ApiKeyError as error:
        raise ProblemError(
            Kind.NOT_SAVED, say("not_saved", "The change was not made: {why}.", why=said_by(error))
        ) from error


def _all_keys(request: Request) -> ApiKeys | None:
    """Return the keys; None without access control, with which nobody needs any."""
    return api_keys_of(shared_of(request).authenticator)


def _keys_of(request: Request, keys: ApiKeys | None) -> Mapping[str, ApiKey]:
    """Return the keys of the site of a request that administrators may see and revoke. An only site has them all."""
    sites = {parts_of(request).id, *([] if sites_of(request).only is None else [None])}
    all_keys = {} if keys is None else keys.all()
    return {name: key for name, key in all_keys.items() if key.site in sites and key.scope is not Scope.ADMIN}


def _shown(identifier: str, key: ApiKey) -> AccessKey:
    return AccessKey.model_validate(
        {
            "id": identifier,
            "name": key.name,
            "scope": None if key.scope is None else key.scope.word,
            "tag": key.tag,
            "made_ns": _ns(key.made),
            "expires_ns": None if key.expires is None else _ns(key.expires),
        }
    )


def _ns(moment: datetime) -> int:
    return int(moment.timestamp() * 1e6) * 1000
