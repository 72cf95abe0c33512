"""The routes for events: pages of stored ones, and a stream of new ones."""

import asyncio
import re
import sqlite3
import time
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from threading import Event as ThreadEvent
from typing import Annotated, Any, Literal

import orjson
from fastapi import Depends, Header, Query, Request
from pydantic import AfterValidator, BeforeValidator, Field
from starlette.responses import Response, StreamingResponse

from dropanchor_schemas.events import EventList
from dropanchor_schemas.zones import EventType
from dropanchor_service.api.formats.tables import events_csv
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.contents import LINES, lines_response
from dropanchor_service.api.routes.parameters import (
    COMMA,
    Ids,
    TagFilter,
    TimeNs,
    example_response,
    ids_of,
    json_response,
    words_of,
)
from dropanchor_service.api.routes.shared_parts import shared_of
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.api.routes.stream import HEARTBEAT_S, MEDIA_TYPE, stopped_within
from dropanchor_service.events.store import EventStore, Selection, StoredEvent

MAX_EVENTS = 1000  # per page, and at once in a stream
POLL_S = 0.1
MAX_SEQUENCE = 2**63 - 1

SEQUENCE = "^[0-9]{1,20}$"

_STREAM = """\
Server-sent events, one for each new event: `id` is its `sequence`, `event` its type, and the data the event. A browser
that connects again sends the last id by itself and misses nothing; another client can use `after`. Without either, the
stream begins with what comes next. While nothing happens, the service sends a comment every 5 s."""


class EventFilter(TagFilter):
    types: Annotated[list[EventType], BeforeValidator(words_of)] = Field(
        default=[],
        description="Return only events of these types. Separate several with commas, or repeat the parameter. The "
        "default is all.",
    )
    zones: Annotated[list[Ids], AfterValidator(ids_of)] = Field(
        default=[], description=f"Return only events of these zones. {COMMA} The default is all."
    )
    after: Annotated[str, Field(pattern=SEQUENCE)] | None = Field(
        default=None, description="Return events that follow the one with this `sequence`."
    )

    def selection(self) -> Selection:
        return Selection(self.tags, [kind.value for kind in self.types], self.zones)

    def position(self) -> int | None:
        return None if self.after is None else min(int(self.after), MAX_SEQUENCE)


class EventPeriod(EventFilter):
    since: TimeNs | None = Field(
        default=None,
        description="Return events from this time on, UTC in ns, or ISO 8601 with a time zone; the oldest first.",
    )
    to: TimeNs | None = Field(default=None, description="Return events up to this time.")

    def selection(self) -> Selection:
        return replace(super().selection(), since_ns=self.since, to_ns=self.to)


class EventQuery(EventPeriod):
    before: Annotated[str, Field(pattern=SEQUENCE)] | None = Field(
        default=None,
        description="Return the newest events before the one with this `sequence`: the first of a page leads to those "
        "before it.",
    )
    limit: int = Field(default=100, ge=1, le=MAX_EVENTS, description="How many events to return.")

    def selection(self) -> Selection:
        before = None if self.before is None else min(int(self.before), MAX_SEQUENCE)
        return replace(super().selection(), before=before)


class EventFileQuery(EventPeriod):
    format: Literal["csv", "jsonl"] = Field(default="csv", description="CSV, or JSON lines: an event in each.")


def _event_stream() -> dict[int | str, dict[str, Any]]:
    example = _message(StoredEvent(42, orjson.dumps(examples.EVENT))).decode()
    return {200: {"content": {MEDIA_TYPE: {"example": example}}}}


async def _refuse_repeated(request: Request) -> None:
    """Refuse a parameter that takes one value but has several."""
    for name in ("after", "before", "since", "to", "limit"):
        if len(request.query_params.getlist(name)) > 1:
            raise ProblemError(Kind.INVALID_REQUEST, f"query.{name}: is given more than once")


def _message(event: StoredEvent) -> bytes:
    kind = orjson.loads(event.body)["type"]
    return f"id: {event.sequence:020}\nevent: {kind}\ndata: ".encode() + event.body + b"\n\n"


router = Router(tags=["events"], dependencies=[Depends(_refuse_repeated)])


@router.get(
    "/events",
    summary="List stored events",
    description="With `since` or `after`, the page begins there and `next` leads on. Without them, or with `before`, "
    "it holds the newest events. Events are always in order.",
    response_model=EventList,
    responses=example_response(examples.EVENTS) | problems(Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE),
)
def list_events(query: Annotated[EventQuery, Query()], request: Request) -> Response:
    store = parts_of(request).events.store
    selection, after = query.selection(), query.position()
    with reading():
        if query.before is not None or (query.since is None and after is None):
            found, leads_on = store.last(query.limit, selection), False
        else:
            found = store.after(after or 0, query.limit, selection)
            leads_on = len(found) == query.limit
    following = f"{found[-1].sequence:020}" if leads_on else None
    return json_response({"events": [orjson.Fragment(event.body) for event in found], "next": following})


@router.get(
    "/events/file",
    summary="Download stored events, as CSV or JSON lines",
    response_class=StreamingResponse,
    responses=problems(Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE) | LINES,
)
def get_events_file(query: Annotated[EventFileQuery, Query()], request: Request) -> Response:
    pages = _pages(parts_of(request).events.store, query)
    return lines_response("events", pages, _as_csv if query.format == "csv" else None, encoded=bytes)


def _as_csv(bodies: Iterable[bytes]) -> Iterator[bytes]:
    return events_csv(map(orjson.loads, bodies))


def _pages(store: EventStore, query: EventFileQuery) -> Iterator[list[bytes]]:
    """Yield all events, page by page. Raises ProblemError."""
    position, selection = query.position() or 0, query.selection()
    while True:
        with reading():
            found = store.after(position, MAX_EVENTS, selection)
        yield [event.body for event in found]
        if len(found) < MAX_EVENTS:
            return
        position = found[-1].sequence


@router.get(
    "/events/stream",
    summary="Stream events as they happen",
    description=_STREAM,
    response_class=StreamingResponse,
    responses=_event_stream() | problems(Kind.INVALID_REQUEST),
)
async def stream_events(
    query: Annotated[EventFilter, Query()],
    request: Request,
    last_event_id: Annotated[
        str | None, Header(description="The last id that the client has. Another text than an id is ignored.")
    ] = None,
) -> Response:
    if last_event_id is not None and re.fullmatch(SEQUENCE, last_event_id):
        query = query.model_copy(update={"after": last_event_id})
    store, stopping = parts_of(request).events.store, shared_of(request).stopping
    headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
    return StreamingResponse(_stream(store, query, stopping), media_type=MEDIA_TYPE, headers=headers)


@contextmanager
def reading() -> Iterator[None]:
    """Turn a failed read of the events into a problem."""
    try:
        yield
    except sqlite3.Error as error:
        raise ProblemError(Kind.EVENTS_UNREADABLE, f"The events cannot be read: {error}.") from error


async def _stream(store: EventStore, query: EventFilter, stopping: ThreadEvent) -> AsyncIterator[bytes]:
    after = query.position()
    position, selection = store.newest if after is None else after, query.selection()
    yield b": alive\n\n"
    sent_s = time.monotonic()
    while True:
        newest = store.newest
        found = await asyncio.to_thread(store.after, position, MAX_EVENTS, selection) if newest > position else []
        if found:
            yield b"".join(map(_message, found))
        elif time.monotonic() - sent_s >= HEARTBEAT_S:
            yield b": alive\n\n"
        if found or time.monotonic() - sent_s >= HEARTBEAT_S:
            sent_s = time.monotonic()
        position = found[-1].sequence if len(found) == MAX_EVENTS else max(position, newest)
        if await stopped_within(POLL_S, stopping):
            return
