"""Write the OpenAPI document into the folder of the schemas, or check with --check whether it is current."""

import json
import sys
from functools import cache
from pathlib import Path
from threading import Event
from typing import Any

from fastapi import FastAPI
from prometheus_client import CollectorRegistry

import dropanchor_schemas
from dropanchor_schemas.site import Site
from dropanchor_service.answers.answers import Answers
from dropanchor_service.api.app import create_app
from dropanchor_service.api.http.site_in_path import OMLOX_PREFIX
from dropanchor_service.api.omlox.document import document_of
from dropanchor_service.api.omlox.router import described_routes
from dropanchor_service.api.routes.shared_parts import SharedParts
from dropanchor_service.api.routes.site_parts import SiteParts
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.store import LatestPoses, SiteStore, TagTable
from dropanchor_service.store.omlox_items import OmloxItems

FILE = Path(dropanchor_schemas.__file__).parent / "openapi.json"


def application(omlox: OmloxItems | None = None) -> FastAPI:
    """Return the application of an only site. omlox: None for no omlox interface."""
    answers = Answers(SiteStore(Site(), {}), TagTable(), LatestPoses())
    site = SiteParts(
        answers,
        receive=lambda _tag, _payload, _encoding: None,
        receive_health=lambda _tag, _payload, _encoding: None,
        plans=PlanStore(None),
        events=EventParts.in_memory(answers.site.site.id),
        omlox=omlox,
    )
    registry = CollectorRegistry()
    return create_app(
        [site], SharedParts(Event()), ready=lambda: (True, []), impaired=list, registry=registry, dashboard=None
    )


@cache
def text() -> str:
    """Return the document as JSON."""
    return json.dumps(application().openapi(), indent=2, ensure_ascii=False) + "\n"


def omlox_document() -> dict[str, Any]:
    """Return the document of the omlox interface."""
    return document_of(described_routes(), f"{OMLOX_PREFIX}v2")


def main(arguments: list[str]) -> int:
    if arguments != ["--check"]:
        FILE.write_text(text(), encoding="utf-8")
        return 0
    if FILE.exists() and FILE.read_text(encoding="utf-8") == text():
        return 0
    sys.stderr.write(f"{FILE.name} is out of date; run python -m dropanchor_service.api.export\n")
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
