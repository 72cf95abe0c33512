"""The REST API over a store that the test fills, called without a network."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any

import httpx
import numpy as np
from fastapi import FastAPI
from prometheus_client import CollectorRegistry

from dropanchor_schemas.answers import Problem
from dropanchor_schemas.site import Anchor, Site
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.app import create_app
from dropanchor_service.api.http.borders import Border
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.shared_parts import SharedParts
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.basemap.basemap import ServedBasemap
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, State, StateReason
from dropanchor_service.history.postgresql.database import Database
from dropanchor_service.history.postgresql.store import PostgresqlStorage
from dropanchor_service.history.sqlite.store import SqliteStorage
from dropanchor_service.history.storage import Retention, Storage
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.recording.recorder import Recorder
from dropanchor_service.security.identity import Authenticator
from dropanchor_service.store import LatestPoses, PendingTags, SiteStore, TagTable
from dropanchor_service.store.omlox_items import OmloxItems

T_NS = 1_800_000_000_000_000_000


@dataclass
class ApiBench:
    """What the API reads. A test changes it and then builds an `app`."""

    answers: Answers
    registry: CollectorRegistry = field(default_factory=CollectorRegistry)
    stopping: Event = field(default_factory=Event)
    not_ready: Sequence[str] = ()
    impaired: Sequence[str] = ()
    now_ns: int = T_NS
    recorder: Recorder | None = None
    received: list[tuple[str, bytes, str]] = field(default_factory=list)
    received_health: list[tuple[str, bytes, str]] = field(default_factory=list)

    def move(self, *names: str, **fields: Any) -> None:
        """Give each named tag a new pose: tracked, of the time `now_ns`, with the given fields of POSE."""
        poses = np.zeros(len(names), POSE)
        poses["row"] = [self.answers.tags.register(name).row for name in names]
        poses["t_ns"], poses["state"], poses["reason"] = self.now_ns, State.TRACKING, StateReason.RESOLVED
        poses["cov"], poses["p_mode"] = np.diag([0.04, 0.01, 0.001]), 1.0
        for name, value in fields.items():
            poses[name] = value
        self.answers.latest.write(poses, np.empty(0, HYPOTHESIS))
        if self.answers.tracks is not None:
            self.answers.tracks.offer(poses)

    def write_history(self) -> None:
        """Write the history to disk now."""
        assert self.answers.tracks is not None
        assert self.answers.tracks.writer.flush()

    def app(
        self,
        dashboard: Path | None = None,
        max_tags: int = 1000,
        authenticator: Authenticator | None = None,
        rate_limiter: RateLimiter | None = None,
        endpoints: tuple[str, ...] = (),
        cors_origins: tuple[str, ...] = (),
        events: EventParts | None = None,
        omlox: OmloxItems | None = None,
        plans: PlanStore | None = None,
        basemap: ServedBasemap | None = None,
    ) -> FastAPI:
        parts = SiteParts(
            self.answers,
            receive=lambda *message: self.received.append(message),
            receive_health=lambda *message: self.received_health.append(message),
            plans=plans or PlanStore(None),
            events=events or EventParts.in_memory(self.answers.site.site.id, lambda: self.answers.now_ns()),
            recorder=self.recorder,
            max_tags=max_tags,
            omlox=omlox,
        )
        parts.events.note_changes(self.answers.site, parts.plans, omlox)
        border = Border(origins=cors_origins)
        return create_app(
            [parts],
            SharedParts(self.stopping, endpoints, None, authenticator, rate_limiter, border, basemap),
            ready=lambda: (not self.not_ready, self.not_ready),
            impaired=lambda: self.impaired,
            registry=self.registry,
            dashboard=dashboard,
        )


def make_api_bench(
    site: Site | None = None,
    folder: Path | None = None,
    retention: Retention | None = None,
    database: Database | None = None,
) -> ApiBench:
    """Return a bench around a site, by default with one anchor.

    folder: where the site and the history are stored. retention: with it there is a history, which has no thread:
    `ApiBench.write_history` writes it. database: where the history is, in place of the folder.
    """
    store = SiteStore(site or Site(anchors=[Anchor(id="17")]), {}, folder)
    tags = TagTable()
    storage: Storage | None = None
    if retention and database:
        storage = PostgresqlStorage(database, store.site.id, retention, lambda: bench.now_ns)
    elif retention and folder:
        storage = SqliteStorage(folder, retention, lambda: bench.now_ns)
    tracks = Tracks(storage, retention, tags, store) if retention and storage else None
    bench = ApiBench(Answers(store, tags, LatestPoses(), tracks=tracks, pending_tags=PendingTags(10)))
    bench.answers.now_ns = lambda: bench.now_ns
    return bench


def ask(app: FastAPI, method: str, path: str, address: str = "127.0.0.1", **options: Any) -> httpx.Response:
    """Return the response of the app to one request. address: the client's IP address."""

    async def request() -> httpx.Response:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False, client=(address, 1234))
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            return await client.request(method, path, **options)

    return asyncio.run(request())


def kind_of(response: httpx.Response) -> str:
    """Return the last part of a problem's type, after a check that the response is a problem document."""
    assert response.headers["content-type"] == "application/problem+json"
    problem = Problem.model_validate(response.json())
    assert problem.status == response.status_code
    return problem.type.removeprefix("urn:dropanchor:problem:")
