"""The routes for networks inside whose machines may receive events, beside those of the settings."""

from typing import Annotated
from urllib.parse import unquote

from fastapi import Depends, Path, Request
from starlette.responses import Response

from dropanchor_schemas.destinations import ReceiverNetwork, ReceiverNetworkList
from dropanchor_schemas.sentences import said_by, say, with_stop
from dropanchor_service.api.http.access import LOOPBACK, client_of
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response, saving
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.delivery.receiver_networks import AllowedNetwork, private_network
from dropanchor_service.store.items import FullError

_EXAMPLE = {"network": "192.168.1.0/24", "in_settings": False}
_DESCRIPTION = """\
Webhooks, and mail servers that the settings name, may then have an address in it, at once. Who may change destinations
can make the service send requests to any machine of the network. The loopback, neighbours on the link, public networks
and the metadata services of clouds are not allowed here: only the settings can. Without access control, only the
machine of the service itself may do this."""


def _network(
    name: Annotated[
        str,
        Path(alias="network", description="The network, percent-escaped.", examples=["192.168.1.0/24"], max_length=100),
    ],
) -> str:
    try:
        return str(private_network(unquote(name)))
    except ValueError as error:
        raise ProblemError(Kind.INVALID_REQUEST, with_stop(said_by(error))) from error


NetworkInPath = Annotated[str, Depends(_network)]


router = Router(tags=["destinations"], dependencies=[NO_QUERY])


@router.get(
    "/receiver-networks",
    summary="List the networks inside whose machines may receive events",
    response_model=ReceiverNetworkList,
    responses=example_response({"networks": [_EXAMPLE]}) | problems(Kind.INVALID_REQUEST),
)
def list_receiver_networks(request: Request) -> Response:
    networks = parts_of(request).events.channels.networks
    of_settings = [ReceiverNetwork(network=str(one), in_settings=True) for one in networks.of_settings]
    of_page = [ReceiverNetwork(network=one, in_settings=False) for one in networks.items.all]
    return json_response({"networks": [one.model_dump() for one in (*of_settings, *of_page)]})


@router.put(
    "/receiver-networks/{network}",
    summary="Allow the machines of a network to receive events",
    description=_DESCRIPTION,
    response_model=ReceiverNetwork,
    responses=example_response(_EXAMPLE)
    | problems(Kind.NO_ACCESS_CONTROL, Kind.ITEMS_FULL, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
)
def allow_receiver_network(network: NetworkInPath, request: Request) -> Response:
    items = parts_of(request).events.channels.networks.items
    _refuse_anybody(request)
    with saving():
        try:
            items.put(network, AllowedNetwork(network=network))
        except FullError as error:
            raise ProblemError(
                Kind.ITEMS_FULL, say("items_full", "There are {n} already. Delete one first.", n=len(items.all))
            ) from error
    return json_response({"network": network, "in_settings": False})


@router.delete(
    "/receiver-networks/{network}",
    summary="Allow a network no longer",
    description="The next event is not sent there, unless the settings allow the network, too.",
    status_code=204,
    responses=problems(Kind.UNKNOWN_NETWORK, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
)
def remove_receiver_network(network: NetworkInPath, request: Request) -> Response:
    items = parts_of(request).events.channels.networks.items
    with saving():
        try:
            items.remove(network)
        except KeyError as error:
            raise ProblemError(
                Kind.UNKNOWN_NETWORK, say("network_unknown", "The page does not allow {network}.", network=network)
            ) from error
    return Response(status_code=204)


def _refuse_anybody(request: Request) -> None:
    """Refuse other machines where there is no access control: anybody could open the network inside."""
    if not hasattr(request.state, "scope") and client_of(request, None) != LOOPBACK:
        raise ProblemError(
            Kind.NO_ACCESS_CONTROL,
            say(
                "network_by_anybody",
                "Without access control anybody could reach the machines inside: open the page on the "
                "machine of the service itself, or secure the site first.",
            ),
        )
