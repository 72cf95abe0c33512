"""Poses as server-sent events: first a snapshot, then the changes, at most as often as the client requests.

Every client reads the store at its own pace. A slow client gets the newest poses, so no queue builds up for it.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Sequence
from threading import Event
from typing import Annotated, Any

import numpy as np
from fastapi import Query, Request
from numpy.typing import NDArray
from pydantic import Field
from starlette.responses import Response, StreamingResponse

from dropanchor_service.answers.answers import EVERYTHING, Answer, Answers, to_json
from dropanchor_service.answers.pose_filter import PoseFilter
from dropanchor_service.api.http.errors import Kind, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import examples
from dropanchor_service.api.routes.parameters import PoseQuery
from dropanchor_service.api.routes.shared_parts import shared_of
from dropanchor_service.api.routes.site_of_request import parts_of

Array = NDArray[Any]  # POSE rows of the store

MEDIA_TYPE = "text/event-stream"
HEARTBEAT_S = 5.0
STATE_CHECK_S = 0.5
_NAP_S = 0.2

_DESCRIPTION = """\
Server-sent events. The first event, `snapshot`, holds every tag that has a pose. Each `poses` event then holds the tags
that have changed since. The data of both is a `PoseFrame`. A tag that no longer meets the conditions of the query is
sent once more, so that a client sees it leave. An event `settings` says that the site, an anchor, a floor plan or the
settings of a tag have changed; its data holds the time alone. A client that reads slowly gets the newest poses when it
is ready again. A client that stops reading is disconnected. While nothing changes, the service sends a comment every
5 s."""


class StreamQuery(PoseQuery):
    max_hz: float = Field(
        default=10.0, ge=0.1, le=30, allow_inf_nan=False, description="The maximum rate of events, Hz."
    )


Versions = Callable[[], Sequence[int]]
"""Returns numbers of which one grows with every change of settings."""


def _event_stream() -> dict[int | str, dict[str, Any]]:
    example = (_event("snapshot", examples.POSE_FRAME) + b": alive\n\n").decode()
    return {200: {"content": {MEDIA_TYPE: {"example": example}}}}


def _event(name: str, frame: Answer) -> bytes:
    return b"event: " + name.encode() + b"\ndata: " + to_json(frame) + b"\n\n"


router = Router(tags=["poses"])


@router.get(
    "/stream",
    summary="Stream poses as they change",
    description=_DESCRIPTION,
    response_class=StreamingResponse,
    responses=_event_stream() | problems(Kind.INVALID_REQUEST),
)
async def stream_poses(query: Annotated[StreamQuery, Query()], request: Request) -> Response:
    parts = parts_of(request)
    answers, plans = parts.answers, parts.plans
    changes = Changes(answers, lambda: (answers.site.version, plans.version), query.tags, query.wanted)
    events = _events(changes, 1 / query.max_hz, shared_of(request).stopping)
    headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
    return StreamingResponse(events, media_type=MEDIA_TYPE, headers=headers)


class Changes:
    """Tracks which changes one client has not received yet."""

    def __init__(self, answers: Answers, versions: Versions, names: list[str], wanted: PoseFilter = EVERYTHING) -> None:
        self._answers = answers
        self._versions = versions
        self._names = names
        self._wanted = wanted
        self._matching = np.empty(0, np.int64)  # rows that met the conditions when they were last looked at
        self._version = 0
        self._sent: dict[str, tuple[str, bool]] = {}  # tag → (state, online)
        self._seen_versions = versions()
        self._checked_s = time.monotonic()

    def snapshot(self) -> Answer:
        """Return a frame of all selected tags."""
        return self._frame(self._leaving_and_matching(self._newer()))

    def next(self) -> Answer | None:
        """Return a frame of the tags that have changed; None when there are none."""
        poses = self._newer()
        if time.monotonic() - self._checked_s >= STATE_CHECK_S:
            self._checked_s = time.monotonic()
            poses = self._with_state_changes(poses)
        poses = self._leaving_and_matching(poses)
        return self._frame(poses) if len(poses) else None

    def settings(self) -> Answer | None:
        """Return an answer with the time if settings have changed, otherwise None."""
        before, self._seen_versions = self._seen_versions, self._versions()
        return None if before == self._seen_versions else {"t_ns": self._answers.now_ns()}

    def _newer(self) -> Array:
        self._version, poses = self._answers.latest.since(self._version)
        return self._selected(poses)

    def _with_state_changes(self, newer: Array) -> Array:
        """Return `newer` and the tags whose state or liveliness has changed without a new pose."""
        all_poses = self._selected(self._answers.latest.since()[1])
        frame = self._answers.frame_of(all_poses, self._answers.now_ns())
        changed = [
            self._sent.get(tag) != (state, online)
            for tag, state, online in zip(frame["tags"], frame["state"], frame["online"], strict=True)
        ]
        return all_poses[np.array(changed, bool) | np.isin(all_poses["row"], newer["row"])]

    def _selected(self, poses: Array) -> Array:
        if not self._names:
            return self._answers.tags.own(poses)
        rows = [tag.row for tag in map(self._answers.tags.find, self._names) if tag is not None]
        return poses[np.isin(poses["row"], rows)]

    def _leaving_and_matching(self, poses: Array) -> Array:
        """Return the poses that meet the conditions, and those of tags that met them until now."""
        if self._wanted.is_everything:
            return poses
        matching = self._wanted.matches(poses, self._answers.tags, self._answers.site, self._answers.now_ns())
        sent = matching | np.isin(poses["row"], self._matching)
        self._matching = np.union1d(np.setdiff1d(self._matching, poses["row"]), poses["row"][matching])
        return poses[sent]

    def _frame(self, poses: Array) -> Answer:
        frame = self._answers.frame_of(poses, self._answers.now_ns())
        sent = zip(frame["state"], frame["online"], strict=True)
        self._sent.update(zip(frame["tags"], sent, strict=True))
        return frame


async def _events(changes: Changes, period_s: float, stopping: Event) -> AsyncIterator[bytes]:
    yield _event("snapshot", changes.snapshot())
    sent_s = time.monotonic()
    while not await stopped_within(period_s, stopping):
        frame, settings = changes.next(), changes.settings()
        if settings is not None:
            yield _event("settings", settings)
        if frame is not None:
            yield _event("poses", frame)
        elif settings is None and time.monotonic() - sent_s >= HEARTBEAT_S:
            yield b": alive\n\n"
        elif settings is None:
            continue
        sent_s = time.monotonic()


async def stopped_within(period_s: float, stopping: Event) -> bool:
    """Sleep for the period and return False; return True within _NAP_S once the service stops."""
    end_s = time.monotonic() + period_s
    while not stopping.is_set():
        left_s = end_s - time.monotonic()
        if left_s <= 0:
            return False
        await asyncio.sleep(min(left_s, _NAP_S))
    return True
