"""The route that says how a tag connects to this site."""

import ipaddress

from fastapi import Request
from starlette.responses import Response

from dropanchor_schemas.answers import Connect
from dropanchor_service.answers.connect_command import reachable_endpoint, simulate_command, tag_command
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.shared_parts import shared_of
from dropanchor_service.api.routes.site_of_request import answers_of
from dropanchor_service.runtime.own_addresses import urls_for_others

SIMULATED_TAG = "sim-1"
_FORWARDED = ("forwarded", "x-forwarded-for", "x-real-ip", "via")


router = Router(tags=["site"], dependencies=[NO_QUERY])


@router.get(
    "/connect",
    summary="Get the endpoints for tags, and a command that starts a simulated tag",
    response_model=Connect,
    responses=example_response(examples.CONNECT) | problems(Kind.INVALID_REQUEST),
)
async def get_connect(request: Request) -> Response:
    site, is_local, shared = answers_of(request).site.site, _is_local(request), shared_of(request)
    reachable = [reachable_endpoint(endpoint, _host(request)) for endpoint in shared.endpoints]
    folder, credentials = None, shared.credentials
    if credentials is not None:
        bundle = credentials.bundle(credentials.table.common_name(site.id, SIMULATED_TAG))
        folder = str(bundle.resolve()) if is_local else bundle.name
    program, anchors = tag_command(show_path=is_local), [anchor.id for anchor in site.anchors]
    command = simulate_command(program, reachable, site.id, anchors, folder)
    answer = {"endpoints": reachable, "credentials": credentials is not None, "simulate": command}
    pages = [] if shared.url is None else [f"{url}/" for url in urls_for_others(shared.url)]
    return json_response(answer | {"pages": pages, "may_simulate": shared.may_simulate})


def _host(request: Request) -> str:
    """Return the host name or address that the client used to reach this machine."""
    name = request.url.hostname or "localhost"
    return f"[{name}]" if ":" in name else name


def _is_local(request: Request) -> bool:
    """Return whether the client runs on this machine. Only then may the answer hold local paths.

    A request with headers of a proxy may come from another machine, so it does not count as local.
    """
    if request.client is None or any(name in request.headers for name in _FORWARDED):
        return False
    return _is_loopback(request.client.host) and _is_loopback(request.url.hostname or "")


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
