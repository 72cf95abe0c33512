"""Serve sites whose tags all have a pose, without an engine: python -m benchmarks.shard BUCKET SITES TAGS_PER_SITE.

It prints "ready", and its port for every line that it reads. It ends with its stdin.
"""

import sys
from collections.abc import Sequence
from threading import Event

import numpy as np
from fastapi import FastAPI
from prometheus_client import CollectorRegistry

from dropanchor_schemas.site import Anchor
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.app import create_app
from dropanchor_service.api.routes.shared_parts import SharedParts
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, State
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.store import LatestPoses, Sites
from support.api_nodes import of_owner
from support.http_server import running_server
from support.sites import T_NS, make_sites


def app_of(sites: Sites, tags: int) -> FastAPI:
    """Return the application of sites with so many tags each."""
    latest, poses = LatestPoses(), np.zeros(len(sites) * tags, POSE)
    poses["row"] = [site.tags.register(f"tag-{tag}").row for site in sites for tag in range(tags)]
    poses["t_ns"], poses["state"], poses["anchor"], poses["p_mode"] = T_NS, State.TRACKING, 0, 1.0
    generator = np.random.default_rng(1)
    poses["x"], poses["y"] = generator.normal(0.0, 50.0, (2, len(poses)))
    poses["cov"] = np.diag([0.04, 0.01, 0.001])
    latest.write(poses, np.empty(0, HYPOTHESIS))
    for site in sites:
        site.store.set_anchor(Anchor(id="7"))
    parts = [
        SiteParts(
            Answers(site.store, site.tags, latest, now_ns=lambda: T_NS, health=site.health),
            receive=lambda *_: None,
            receive_health=lambda *_: None,
            plans=PlanStore(None),
            events=EventParts.in_memory(site.id),
            recorder=None,
            max_tags=tags,
            omlox=None,
        )
        for site in sites
    ]
    return create_app(
        parts, SharedParts(Event()), ready=lambda: (True, []), impaired=list, registry=CollectorRegistry()
    )


def main(arguments: Sequence[str]) -> None:
    bucket, sites, tags = arguments[0], int(arguments[1]), int(arguments[2])
    app = app_of(make_sites(*(f"{bucket}.site-{index}" for index in range(sites))), tags)
    with running_server(of_owner(app, bucket), Event()) as port:
        print("ready", flush=True)
        for _ in sys.stdin:
            print(port, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
