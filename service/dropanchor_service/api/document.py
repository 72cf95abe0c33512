"""The OpenAPI document of the interface."""

import re
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from dropanchor_schemas.answers import Problem, SamplesAcknowledged
from dropanchor_schemas.features import FeatureItemAlone, FeaturePage
from dropanchor_schemas.geojson import PoseFeatureCollection, TimedPoseFeature, TrackFeatureCollection
from dropanchor_schemas.pose import PoseFrame
from dropanchor_schemas.samples import SamplesMessage
from dropanchor_schemas.tag_health import TagHealthMessage
from dropanchor_service.api.http.errors import MEDIA_TYPE, TYPE_PREFIX, Kind, problems
from dropanchor_service.api.http.permissions import OPEN_PATHS
from dropanchor_service.api.http.site_in_path import knows_no_422
from dropanchor_service.api.request_models import separate_requests

_KINDS_IN = re.compile(f"`{TYPE_PREFIX}([a-z-]+)`")


def openapi_of(app: FastAPI) -> dict[str, Any]:
    """Return the OpenAPI document, built once."""
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title, version=app.version, description=_DESCRIPTION, routes=app.routes, tags=_TAGS
        )
        for model in (
            FeatureItemAlone,
            FeaturePage,
            PoseFeatureCollection,
            PoseFrame,
            Problem,
            SamplesAcknowledged,
            SamplesMessage,
            TagHealthMessage,
            TimedPoseFeature,
            TrackFeatureCollection,
        ):  # of no route, or not its only model
            schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
            document["components"]["schemas"] |= schema.pop("$defs", {}) | {model.__name__: schema}
        document["components"]["schemas"]["Problem"]["description"] = _types_of_problems()
        separate_requests(document)
        _add_access(document)
        _share_refusals(document)
        app.openapi_schema = document
    return app.openapi_schema


def _add_access(document: dict[str, Any]) -> None:
    """Add the bearer scheme and the responses of refused requests to every protected operation."""
    document["components"]["securitySchemes"] = {
        "bearer": {
            "type": "http",
            "scheme": "bearer",
            "description": "An API key, or a token of the site's OpenID Connect provider.",
        }
    }
    refusals = {str(status): response for status, response in problems(*_REFUSALS).items()}
    for path, operations in document["paths"].items():
        for operation in operations.values() if path not in OPEN_PATHS else ():
            if knows_no_422(path):
                operation["responses"]["400"] = operation["responses"].pop("422")
            operation["responses"] = dict(sorted((operation["responses"] | refusals).items()))
            operation["security"] = [{"bearer": []}, {}]


def _share_refusals(document: dict[str, Any]) -> None:
    """Describe each refusal once, among the components: most operations have the same ones."""
    shared: dict[str, Any] = {}
    for operations in document["paths"].values():
        for operation in operations.values():
            for status, response in operation["responses"].items():
                if MEDIA_TYPE in response.get("content", {}):
                    name = ".".join([status, *_KINDS_IN.findall(response["description"])])
                    if shared.setdefault(name, response) == response:
                        operation["responses"][status] = {"$ref": f"#/components/responses/{name}"}
    document["components"]["responses"] = dict(sorted(shared.items()))


_REFUSALS = (
    Kind.UNAUTHENTICATED,
    Kind.FORBIDDEN,
    Kind.OTHER_ORIGIN,
    Kind.OTHER_HOST,
    Kind.TOO_MANY_REQUESTS,
)
_TAGS = [
    {"name": "poses", "description": "Where the tags are."},
    {"name": "features", "description": "Tags, zones and tracks for programs of maps: OGC API – Features."},
    {"name": "tags", "description": "What the tags have sent, and their settings."},
    {"name": "site", "description": "The site frame, its georeference, and the anchors."},
    {"name": "plans", "description": "Floor plans below the tags on the map, and their images."},
    {"name": "basemap", "description": "A map of the surroundings behind a site with latitude and longitude."},
    {"name": "zones", "description": "Areas of the site, and the rules that make events."},
    {"name": "events", "description": "What has happened, as CloudEvents."},
    {"name": "destinations", "description": "Who gets events by webhook, e-mail or MQTT."},
    {"name": "shares", "description": "Links that show the page, read only, until they expire."},
    {"name": "keys", "description": "API keys for people, programs and phones."},
    {"name": "ingest", "description": "Samples over HTTP, for tags that do not speak Zenoh."},
    {
        "name": "past",
        "description": "What the black box knows: raw samples of the last hours, and what became of them.",
    },
    {"name": "recordings", "description": "MCAP files with raw samples and poses."},
    {"name": "health", "description": "Health checks for supervisors, and metrics for Prometheus."},
]


_DESCRIPTION = """\
Live positions of a fleet of tags around one UWB anchor. All values are in SI units. The site frame is ENU with x
pointing east. Times are UTC in nanoseconds. Every error is a problem document (RFC 9457): the schema `Problem`, at the
end, lists the types."""


def _types_of_problems() -> str:
    """Return the table of the schema `Problem`: before the operations, a page would begin with nothing else."""
    rows = "\n".join(f"| `{kind.type}` | {kind.status} | {kind.title} |" for kind in Kind)
    return f"Problem details (RFC 9457).\n\n| type | status | title |\n|---|---|---|\n{rows}\n"
