"""The routes for destinations: who gets which events, a test, and what could not be delivered."""

from typing import Annotated

import orjson
from fastapi import Body, Request
from starlette.responses import Response

from dropanchor_schemas.destinations import (
    DeadLetterList,
    Destination,
    DestinationList,
    DestinationState,
    DestinationTest,
    MqttPosesDestination,
    Retried,
    WebhookDestination,
)
from dropanchor_schemas.sentences import phrase_of, said_by, with_stop
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.etags import Conditions
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.events import reading
from dropanchor_service.api.routes.items import CHANGE_KINDS, DestinationId, delete, found, item_response, put
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.delivery import write_only
from dropanchor_service.delivery.channel import ChannelError, Verdict
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.events.deliveries import QueueState
from dropanchor_service.events.drafts import destination_test
from dropanchor_service.events.store import cloud_event

_READ = (Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE)
_ONE = (Kind.UNKNOWN_DESTINATION, *_READ)


router = Router(tags=["destinations"], dependencies=[NO_QUERY])


@router.get(
    "/destinations",
    summary="List the destinations and the state of their queues",
    response_model=DestinationList,
    responses=example_response({"destinations": [examples.DESTINATION_STATE], "unavailable": {}}) | problems(*_READ),
)
def list_destinations(request: Request) -> Response:
    parts = parts_of(request).events
    with reading():
        queues = parts.deliveries.states()
    states = [_state(parts, one, queues.get(one.id, QueueState())) for one in parts.destinations.all.values()]
    listed = [state.model_dump(mode="json") for state in states]
    unavailable = parts.channels.unavailable()
    phrases = {kind: phrase_of(why) for kind, why in unavailable.items()}
    return json_response({"destinations": listed, "unavailable": unavailable, "unavailable_phrases": phrases})


@router.get(
    "/destinations/{destination}",
    summary="Get a destination and the state of its queue",
    response_model=DestinationState,
    responses=example_response(examples.DESTINATION_STATE) | problems(*_ONE),
)
def get_destination(destination: DestinationId, request: Request) -> Response:
    parts = parts_of(request).events
    return _response(parts, found(parts.destinations, destination, Kind.UNKNOWN_DESTINATION))


@router.put(
    "/destinations/{destination}",
    summary="Create or replace a destination",
    description="It gets the events from now on. A webhook inside needs its network among those of receivers: a "
    "refusal for that names it as `network`. An e-mail needs a mail server, and MQTT a broker. The poses of "
    "`mqtt_poses` are no events: they have no queue.",
    response_model=DestinationState,
    responses=example_response(examples.DESTINATION_STATE) | problems(Kind.DESTINATION_REFUSED, *CHANGE_KINDS, *_READ),
)
def put_destination(
    destination: DestinationId,
    body: Annotated[Destination, Body(examples=[examples.WEBHOOK])],
    allows: Conditions,
    request: Request,
) -> Response:
    parts = parts_of(request).events
    usable = _usable(parts, body)
    put(parts.destinations, destination, body.id, usable, allows)
    if isinstance(usable, MqttPosesDestination):  # which has no queue, if it was of another type before
        with reading():
            parts.deliveries.drop(destination)
    return _response(parts, usable)


@router.delete(
    "/destinations/{destination}",
    summary="Delete a destination and its queue",
    status_code=204,
    responses=problems(Kind.CHANGED_MEANWHILE, Kind.NOT_SAVED, *_ONE),
)
def delete_destination(destination: DestinationId, allows: Conditions, request: Request) -> Response:
    parts = parts_of(request).events
    response = delete(parts.destinations, destination, allows, Kind.UNKNOWN_DESTINATION)
    with reading():
        parts.deliveries.drop(destination)
    return response


@router.post(
    "/destinations/{destination}/test",
    summary="Send a test event to a destination now",
    response_model=DestinationTest,
    responses=example_response(examples.DESTINATION_TEST) | problems(Kind.DESTINATION_REFUSED, *_ONE),
)
async def test_destination(destination: DestinationId, request: Request) -> Response:
    parts = parts_of(request).events
    known = found(parts.destinations, destination, Kind.UNKNOWN_DESTINATION)
    try:
        parts.channels.check_settings(known)
    except ChannelError as error:
        raise ProblemError(Kind.DESTINATION_REFUSED, with_stop(said_by(error))) from error
    async with parts.channels.open(known) as channel:
        outcome = (await channel.send([cloud_event(destination_test(known.id), 0, parts.store.site)]))[0]
    answer = {"delivered": outcome.verdict is Verdict.ACCEPTED, "detail": outcome.warning or outcome.detail}
    return json_response(answer)


@router.get(
    "/destinations/{destination}/dead-letters",
    summary="List the events whose delivery was given up",
    response_model=DeadLetterList,
    responses=example_response(examples.DEAD_LETTERS) | problems(*_ONE),
)
def list_dead_letters(destination: DestinationId, request: Request) -> Response:
    parts = parts_of(request).events
    found(parts.destinations, destination, Kind.UNKNOWN_DESTINATION)
    with reading():
        dead = parts.deliveries.dead(destination)
    letters = [{"event": orjson.Fragment(body), "reason": reason} for body, reason in dead]
    return json_response({"dead_letters": letters})


@router.post(
    "/destinations/{destination}/dead-letters/retry",
    summary="Put the dead letters of a destination back into its queue",
    description="A dead letter goes back by itself once, an hour after it became one.",
    response_model=Retried,
    responses=example_response({"retried": 1}) | problems(*_ONE),
)
def retry_dead_letters(destination: DestinationId, request: Request) -> Response:
    site = parts_of(request)
    found(site.events.destinations, destination, Kind.UNKNOWN_DESTINATION)
    with reading():
        return json_response({"retried": site.events.deliveries.retry(destination, site.answers.now_ns())})


@router.delete(
    "/destinations/{destination}/dead-letters",
    summary="Drop the dead letters of a destination",
    description="The events themselves stay.",
    status_code=204,
    responses=problems(*_ONE),
)
def delete_dead_letters(destination: DestinationId, request: Request) -> Response:
    parts = parts_of(request).events
    found(parts.destinations, destination, Kind.UNKNOWN_DESTINATION)
    with reading():
        parts.deliveries.drop_dead(destination)
    return Response(status_code=204)


def _usable(parts: EventParts, destination: Destination) -> Destination:
    """Return the destination with what it keeps. Raises ProblemError when nothing could be delivered to it."""
    try:
        whole = write_only.completed(destination, parts.destinations.all.get(destination.id))
        parts.channels.check(whole)
    except ChannelError as error:
        members = {} if error.network is None else {"network": error.network}
        raise ProblemError(Kind.DESTINATION_REFUSED, with_stop(said_by(error)), **members) from error
    except write_only.NotShownError as error:
        raise ProblemError(Kind.DESTINATION_REFUSED, with_stop(said_by(error))) from error
    return whole


def _response(parts: EventParts, destination: Destination) -> Response:
    with reading():
        queue = parts.deliveries.states().get(destination.id, QueueState())
    return item_response(destination, _state(parts, destination, queue))


def _state(parts: EventParts, destination: Destination, queue: QueueState) -> DestinationState:
    has_secret = isinstance(destination, WebhookDestination) and destination.secret is not None
    shown, problem = write_only.shown(destination), parts.problem_of(destination.id)
    return DestinationState(destination=shown, has_secret=has_secret, problem=problem, **queue._asdict())
