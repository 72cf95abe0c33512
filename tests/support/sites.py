"""The sites of a process without its other parts."""

from functools import partial
from threading import Event

import numpy as np
from fastapi import FastAPI
from prometheus_client import CollectorRegistry

from dropanchor_schemas.site import Anchor, Site
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.app import create_app
from dropanchor_service.api.routes.shared_parts import SharedParts
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, State
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.security.identity import Authenticator
from dropanchor_service.settings.quota import Quota
from dropanchor_service.store import LatestPoses, Sites, SiteStore
from dropanchor_service.store.omlox_items import OmloxItems

T_NS = 1_800_000_000_000_000_000


def make_sites(*names: str) -> Sites:
    """Return sites without anchors and tags; without names, the one that a service has by default."""
    return Sites([(SiteStore(Site(id=name), {}), Quota()) for name in names or ("default",)])


def app_of_sites(
    sites: Sites,
    authenticator: Authenticator | None = None,
    received: list[tuple[str, str, bytes, str]] | None = None,
    stopping: Event | None = None,
    latest: LatestPoses | None = None,
) -> FastAPI:
    """Return the application of these sites. The tag "cart" of each site stands at x = 1, 2, …

    received: gets the samples and the health that come over HTTP: site, tag, payload, encoding. latest: where the
    poses are.
    """
    latest, came = latest or LatestPoses(), [] if received is None else received
    poses = np.zeros(len(sites), POSE)
    for site in sites:
        site.store.set_anchor(Anchor(id="7"))
        poses[site.index]["row"] = site.tags.register("cart").row
        poses[site.index]["x"] = site.index + 1
    poses["t_ns"], poses["state"], poses["anchor"], poses["p_mode"] = T_NS, State.TRACKING, 0, 1.0
    latest.write(poses, np.empty(0, HYPOTHESIS))

    def take(site: str, tag: str, payload: bytes, encoding: str) -> None:
        came.append((site, tag, payload, encoding))

    parts = [
        SiteParts(
            Answers(site.store, site.tags, latest, now_ns=lambda: T_NS, health=site.health),
            receive=partial(take, site.id),
            receive_health=partial(take, site.id),
            plans=PlanStore(None),
            events=EventParts.in_memory(site.id),
            omlox=OmloxItems.opened(None),
            max_tags=1 if site.id == "full" else 10,
        )
        for site in sites
    ]
    return create_app(
        parts,
        SharedParts(stopping or Event(), authenticator=authenticator),
        ready=lambda: (True, []),
        impaired=list,
        registry=CollectorRegistry(),
    )
