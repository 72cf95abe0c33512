"""The routes for alarms: what rules have begun, until it is over, and who has seen it."""

from typing import Annotated, Any, Literal

import orjson
from fastapi import Body, Depends, Query, Request
from pydantic import Field
from starlette.responses import Response

from dropanchor_schemas.alarms import Acknowledgement, AcknowledgementNote, Alarm, AlarmList
from dropanchor_schemas.audit import Author
from dropanchor_schemas.sentences import say
from dropanchor_service.answers.answers import Answer
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.events import MAX_EVENTS, MAX_SEQUENCE, SEQUENCE, reading
from dropanchor_service.api.routes.items import path_id
from dropanchor_service.api.routes.parameters import NO_QUERY, TagFilter, example_response, json_response, saving
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.events.alarms import CURRENT, OPEN, StoredAlarm, alarm_of, alarms
from dropanchor_service.store.trail import SERVICE, WHO, Change

_CONDITIONS = {"current": CURRENT, "open": OPEN, "all": "1"}
_DESCRIPTION = """\
The newest first. An alarm begins with an event of a zone or rule with the severity `warning` or `alarm`, and is over
when what it is about is: a lost tag is found, a tag has left the zone, or nobody watches it any longer. The stream of
events tells of each beginning, acknowledgement and end."""


class AlarmQuery(TagFilter):
    state: Literal["current", "open", "all"] = Field(
        default="current",
        description="`open`: those that are not over. `current`: also those that are, and that nobody has "
        "acknowledged. `all`: all that are kept, as long as events are.",
    )
    before: Annotated[str, Field(pattern=SEQUENCE)] | None = Field(
        default=None, description="Only alarms that began before the event with this `sequence`: `next` of a page."
    )
    limit: int = Field(default=100, ge=1, le=MAX_EVENTS, description="How many alarms to return.")


router = Router(tags=["events"])


@router.get(
    "/alarms",
    summary="List the alarms",
    description=_DESCRIPTION,
    response_model=AlarmList,
    responses=example_response({"alarms": [examples.ALARM], "next": None})
    | problems(Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE),
)
def list_alarms(query: Annotated[AlarmQuery, Query()], request: Request) -> Response:
    events, before = parts_of(request).events, min(int(query.before or MAX_SEQUENCE), MAX_SEQUENCE)
    with reading():
        found = alarms(events.store.database, _CONDITIONS[query.state], before, query.tags, query.limit + 1)
    shown = found[: query.limit]
    following = f"{shown[-1].sequence:020}" if len(found) > len(shown) else None
    return json_response({"alarms": [_answer(events, alarm) for alarm in shown], "next": following})


@router.put(
    "/alarms/{alarm}/acknowledgement",
    summary="Acknowledge an alarm",
    description="It goes on until it is over. Who acknowledged it stands in the trail of changes, too. Once more "
    "replaces what was noted.",
    response_model=Alarm,
    responses=example_response(examples.ALARM)
    | problems(Kind.UNKNOWN_ALARM, Kind.BODY_TOO_LARGE, Kind.NOT_SAVED, Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE),
    dependencies=[NO_QUERY],
)
def acknowledge_alarm(
    alarm: Annotated[str, Depends(path_id("alarm", examples.ALARM["id"]))],
    body: Annotated[AcknowledgementNote, Body(examples=[{"note": "the driver has been told"}])],
    request: Request,
) -> Response:
    parts = parts_of(request)
    who, before = WHO.get(SERVICE), _found(parts.events, alarm).acknowledged
    author = Author.model_validate(who._asdict())
    said = Acknowledgement(by=author, t_ns=parts.answers.now_ns(), note=body.note)
    known = None if before is None else Acknowledgement.model_validate_json(before)
    with saving(), reading(), parts.events.trail.changing(Change("alarm", alarm, known, said)):
        parts.events.store.acknowledge(alarm, said)
    return json_response(_answer(parts.events, _found(parts.events, alarm)))


def _found(events: EventParts, alarm: str) -> StoredAlarm:
    with reading():
        found = alarm_of(events.store.database, alarm)
    if found is None:
        raise ProblemError(Kind.UNKNOWN_ALARM, say("alarm_unknown", "There is no alarm {id}.", id=repr(alarm)))
    return found


def _answer(events: EventParts, alarm: StoredAlarm) -> Answer:
    items: Any = events.items.zones if alarm.source == "zone" else events.items.rules
    item, event = items.all.get(alarm.item), orjson.loads(alarm.body)
    return {
        "id": alarm.id,
        "severity": alarm.severity,
        "began_ns": event["data"]["since_ns"],
        "over_ns": alarm.over_ns,
        "acknowledged": None if alarm.acknowledged is None else orjson.Fragment(alarm.acknowledged),
        "muted_until_ns": None if item is None else item.muted_until_ns,
        "event": event,
    }
