"""The routes of OGC API – Features, Part 1 (OGC 17-069r4): tags, zones and tracks for any program of maps."""

import re
from typing import Annotated, Any
from urllib.parse import quote, unquote, urlencode

from fastapi import Depends, Path, Query, Request
from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from starlette.responses import Response

from dropanchor_schemas.features import (
    FeatureCollectionInfo,
    FeatureCollectionList,
    FeatureItemAlone,
    FeaturePage,
    FeaturesConformance,
    FeaturesLandingPage,
)
from dropanchor_schemas.site import ID_SCHEMA
from dropanchor_schemas.times import ns_of_iso
from dropanchor_service.answers.answers import Answer
from dropanchor_service.answers.times import iso_utc
from dropanchor_service.api.formats import geojson
from dropanchor_service.api.http.behind_proxy import prefix_of
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes.contents import schema_of
from dropanchor_service.api.routes.feature_collections import COLLECTIONS, Span, box_of, features_of
from dropanchor_service.api.routes.parameters import NO_QUERY, json_response
from dropanchor_service.api.routes.period import reading_history
from dropanchor_service.api.routes.site_of_request import parts_of

CRS84 = "http://www.opengis.net/def/crs/OGC/1.3/CRS84"
CONFORMS_TO = [f"http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/{name}" for name in ("core", "geojson")]
MAX_LIMIT = 10_000
_ROOT = "/ogc"
_OF_SITE = re.compile(r"/api/v1(/sites/[^/]+(?=/ogc))?")
_NUMBER = r"-?[0-9]{1,9}(\.[0-9]{1,20})?"
_READS = (Kind.NOT_FOUND, Kind.NOT_GEOREFERENCED, Kind.NO_HISTORY, Kind.HISTORY_UNREADABLE, Kind.INVALID_REQUEST)


async def _collection_id(
    collection: Annotated[
        str, Path(description="The id of the collection.", json_schema_extra={"enum": list(COLLECTIONS)})
    ],
) -> str:
    if collection not in COLLECTIONS:
        raise ProblemError(Kind.NOT_FOUND, f"There is no such collection; there are: {', '.join(COLLECTIONS)}.")
    return collection


InCollection = Annotated[str, Depends(_collection_id)]
ItemId = Annotated[
    str,
    Path(description="The id of the tag or zone, percent-escaped.", json_schema_extra=ID_SCHEMA, examples=["tag-1"]),
]


def _times_of(text: str) -> Span:
    begin, slash, end = text.partition("/")
    ends = [None if one in ("", "..") else ns_of_iso(one.replace(" ", "+")) for one in (begin, end if slash else begin)]
    return ends[0], ends[1]


def _require_times(text: str) -> str:
    begin, end = _times_of(text)
    if begin is not None and end is not None and end < begin:
        raise ValueError("ends before it begins")
    return text


class ItemsQuery(BaseModel):
    """The query of the features of a collection."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    bbox: Annotated[str, Field(pattern=rf"^{_NUMBER}(,{_NUMBER}){{3}}((,{_NUMBER}){{2}})?$")] | None = Field(
        default=None,
        description="Return only features that reach into this box of WGS 84: west,south,east,north in degrees; with "
        "heights after south and north, these are ignored.",
        examples=["13.3,52.4,13.5,52.6"],
    )
    times: Annotated[str, AfterValidator(_require_times)] | None = Field(
        default=None,
        alias="datetime",
        max_length=100,
        description="A time, or two with a slash between them, as ISO 8601 with a time zone; `..` leaves one open. "
        "Tags by their latest pose; of tracks, the part in between, by default the last hour.",
        examples=["2027-01-15T08:00:00Z/.."],
    )
    limit: Annotated[int, AfterValidator(lambda limit: min(limit, MAX_LIMIT))] = Field(
        default=1000,
        ge=1,
        json_schema_extra={"maximum": MAX_LIMIT},
        description="The maximum number of features on a page. More than the largest stand for the largest.",
    )
    offset: int = Field(default=0, ge=0, lt=2**31, description="How many features to leave out: see the link `next`.")


router = Router(tags=["features"])


def _link(request: Request, path: str, rel: str, media_type: str = geojson.JSON) -> dict[str, str]:
    """Return a link. path: below that of the interface or, of these routes, below that of the site."""
    found = _OF_SITE.match(request.scope["path"]) if path.startswith(_ROOT) else None
    below = "/api/v1" if found is None else found[0]
    href = f"{str(request.base_url).rstrip('/')}{prefix_of(request)}{below}{path}"
    return {"href": href, "rel": rel, "type": media_type}


@router.get(
    _ROOT,
    summary="Find what OGC API – Features has here",
    description="Give this address to QGIS, GDAL (`OAPIF:`) or any other client of OGC API – Features.",
    response_model=FeaturesLandingPage,
    responses=problems(Kind.INVALID_REQUEST),
    dependencies=[NO_QUERY],
)
def get_features_landing_page(request: Request) -> Response:
    links = [
        _link(request, _ROOT, "self"),
        _link(request, "/openapi.json", "service-desc", "application/vnd.oai.openapi+json;version=3.1"),
        _link(request, f"{_ROOT}/conformance", "conformance"),
        _link(request, f"{_ROOT}/collections", "data"),
    ]
    return json_response({"title": parts_of(request).id, "description": "Tags, zones and tracks.", "links": links})


@router.get(
    f"{_ROOT}/conformance",
    summary="List what of OGC API – Features holds here",
    response_model=FeaturesConformance,
    responses=problems(Kind.INVALID_REQUEST),
    dependencies=[NO_QUERY],
)
def get_features_conformance() -> Response:
    return json_response({"conformsTo": CONFORMS_TO})


@router.get(
    f"{_ROOT}/collections",
    summary="List the collections of features",
    response_model=FeatureCollectionList,
    responses=problems(Kind.INVALID_REQUEST),
    dependencies=[NO_QUERY],
)
def list_feature_collections(request: Request) -> Response:
    links = [_link(request, f"{_ROOT}/collections", "self")]
    return json_response({"links": links, "collections": [_described(request, name) for name in COLLECTIONS]})


@router.get(
    f"{_ROOT}/collections/{{collection}}",
    summary="Get a collection of features",
    response_model=FeatureCollectionInfo,
    responses=problems(Kind.NOT_FOUND, Kind.INVALID_REQUEST),
    dependencies=[NO_QUERY],
)
def get_feature_collection(collection: InCollection, request: Request) -> Response:
    return json_response(_described(request, collection))


def _offers(model: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    return {200: {"content": {geojson.MEDIA_TYPE: {"schema": schema_of(model)}}}}


@router.get(
    f"{_ROOT}/collections/{{collection}}/items",
    summary="List the features of a collection",
    response_class=Response,
    responses=_offers(FeaturePage) | problems(*_READS),
)
def list_features(collection: InCollection, query: Annotated[ItemsQuery, Query()], request: Request) -> Response:
    box = None if query.bbox is None else box_of(query.bbox)
    found = _read(request, collection, (None, None) if query.times is None else _times_of(query.times), box)
    page = found[query.offset : query.offset + query.limit]
    links = [_page(request, collection, query, "self", query.offset)]
    if query.offset + len(page) < len(found):
        links.append(_page(request, collection, query, "next", query.offset + query.limit))
    counts = {"numberMatched": len(found), "numberReturned": len(page)}
    now = iso_utc(parts_of(request).answers.now_ns())
    answer = {"type": "FeatureCollection", "timeStamp": now, **counts, "features": page, "links": links}
    return json_response(answer, geojson.MEDIA_TYPE)


@router.get(
    f"{_ROOT}/collections/{{collection}}/items/{{item}}",
    summary="Get a feature of a collection",
    response_class=Response,
    responses=_offers(FeatureItemAlone) | problems(*_READS),
    dependencies=[NO_QUERY],
)
def get_feature(collection: InCollection, item: ItemId, request: Request) -> Response:
    name = unquote(item)
    for feature in _read(request, collection):
        if feature["id"] == name:
            path = f"{_ROOT}/collections/{collection}"
            links = [
                _link(request, f"{path}/items/{quote(name, safe='')}", "self", geojson.MEDIA_TYPE),
                _link(request, path, "collection"),
            ]
            return json_response(feature | {"links": links}, geojson.MEDIA_TYPE)
    raise ProblemError(Kind.NOT_FOUND, f"The collection {collection} has no such feature.")


def _described(request: Request, name: str) -> Answer:
    path, found = f"{_ROOT}/collections/{name}", COLLECTIONS[name]
    links = [_link(request, path, "self"), _link(request, f"{path}/items", "items", geojson.MEDIA_TYPE)]
    said = {"id": name, "title": found.title, "description": found.description}
    return said | {"itemType": "feature", "crs": [CRS84], "links": links}


def _page(request: Request, collection: str, query: ItemsQuery, rel: str, offset: int) -> dict[str, str]:
    told = {"bbox": query.bbox, "datetime": query.times, "limit": query.limit, "offset": offset}
    words = urlencode({name: value for name, value in told.items() if value is not None})
    return _link(request, f"{_ROOT}/collections/{collection}/items?{words}", rel, geojson.MEDIA_TYPE)


def _read(request: Request, collection: str, span: Span = (None, None), box: Any = None) -> list[Answer]:
    with reading_history():
        return features_of(parts_of(request), collection, span, box)
