"""The routes for the images of floor plans."""

from typing import Annotated, Any

from fastapi import Path, Query, Request
from fastapi.concurrency import run_in_threadpool
from pydantic import Field
from starlette.responses import Response

from dropanchor_schemas.models import Exact
from dropanchor_schemas.plans import PlanImage, UploadedPlanImage
from dropanchor_schemas.sentences import said_by, say
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.router import Router
from dropanchor_service.api.routes import plan_examples as examples
from dropanchor_service.api.routes.contents import BYTES
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response, saving
from dropanchor_service.api.routes.site_of_request import parts_of
from dropanchor_service.plans.reading.file_types import file_type_of
from dropanchor_service.plans.reading.messages import Request as ReadRequest
from dropanchor_service.plans.reading.refused import RefusedError
from dropanchor_service.plans.store import PlanStore
from dropanchor_service.plans.upload import PlanReader
from dropanchor_service.store.site import SiteStore

MAX_UPLOAD_BYTES = 32 * 2**20

_NUMBER = r"[+-]?[0-9]{1,15}(\.[0-9]{1,18})?([eE][+-]?[0-9]{1,2})?"
_UPLOADED = ("image/png", "image/jpeg", "image/tiff", "image/svg+xml", "application/pdf", "application/octet-stream")
_SHOWN = ("image/png", "image/jpeg", "image/svg+xml")
_HEADERS = {
    "cache-control": "private, max-age=31536000, immutable",
    "content-security-policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox; "
    "frame-ancestors 'none'",
}
_DESCRIPTION = f"""\
The body is the file: PNG, JPEG, SVG, a PDF of which one page is drawn, or TIFF. It has at most \
{MAX_UPLOAD_BYTES >> 20} MiB and 40 megapixels. The type of its content counts: another `Content-Type` is refused, and \
so is an SVG that refers to other files. The answer holds a `placement` if the site has a georeference and the file is \
a GeoTIFF or comes with a world file.

Put the `image` of the answer into a plan. The service keeps the last images that no plan uses."""


class UploadQuery(Exact):
    page: int = Field(default=1, ge=1, le=10_000, description="Page of a PDF.")
    world: Annotated[str, Field(pattern=rf"^{_NUMBER}(,{_NUMBER}){{5}}$")] | None = Field(
        default=None,
        description="The six lines of a world file, with commas between them.",
        examples=["0.05,0,0,-0.05,389500.025,5819999.975"],
    )
    crs: Annotated[str, Field(pattern="^(site|EPSG:[0-9]{1,6})$")] | None = Field(
        default=None,
        description="Coordinate system of the world file, or of a GeoTIFF that names none: an EPSG code, or `site` for "
        "the frame of the site.",
        examples=["EPSG:25833"],
    )

    def to_read(self, media_type: str, site: SiteStore) -> ReadRequest:
        """Return what the reader must know of an upload."""
        return ReadRequest(
            media_type=media_type,
            page=self.page,
            world=None if self.world is None else [float(number) for number in self.world.split(",")],
            crs=self.crs or "",
            georeference=site.site.georeference,
        )


def _binary(*media_types: str) -> dict[str, Any]:
    return dict.fromkeys(media_types, BYTES)


router = Router(tags=["plans"])
_READER = PlanReader()


@router.post(
    "/plan-images",
    summary="Upload the image of a floor plan",
    description=_DESCRIPTION,
    response_model=UploadedPlanImage,
    status_code=201,
    responses=example_response(examples.UPLOADED, 201)
    | problems(Kind.PLAN_IMAGE_REFUSED, Kind.BODY_TOO_LARGE, Kind.INVALID_REQUEST, Kind.NOT_SAVED),
    openapi_extra={"requestBody": {"required": True, "content": _binary(*_UPLOADED)}},
)
async def upload_plan_image(request: Request, query: Annotated[UploadQuery, Query()]) -> Response:
    parts, content = parts_of(request), await request.body()
    try:
        media_type = file_type_of(content, request.headers.get("content-type", ""))
        read = await _READER.read(content, query.to_read(media_type, parts.answers.site))
    except RefusedError as error:
        raise ProblemError(Kind.PLAN_IMAGE_REFUSED, said_by(error)) from error
    with saving():
        image = await run_in_threadpool(parts.plans.add_image, read)
    found = read.description
    uploaded = UploadedPlanImage(
        image=image, pages=found.pages, placement=found.placement, note=found.note, note_phrase=found.note_phrase
    )
    return json_response(uploaded.model_dump(), status=201)


@router.get(
    "/plan-images/{image}",
    summary="Get the image of a floor plan",
    description="It never changes, so a client need not request it again.",
    response_class=Response,
    responses=problems(Kind.UNKNOWN_PLAN_IMAGE, Kind.INVALID_REQUEST, Kind.NOT_SAVED)
    | {200: {"content": _binary(*_SHOWN)}},
    dependencies=[NO_QUERY],
)
def get_plan_image(
    image: Annotated[
        str, Path(pattern="^[0-9a-f]{32}$", description="Id of the image.", examples=[examples.IMAGE["id"]])
    ],
    request: Request,
) -> Response:
    store = parts_of(request).plans
    known = store.image(image)
    content = None if known is None else _content(store, known)
    if known is None or content is None:
        raise ProblemError(Kind.UNKNOWN_PLAN_IMAGE, say("plan_gone", "There is no such image. Upload it again."))
    headers = _HEADERS | {"etag": f'"{known.id}"'}
    return Response(content, media_type=known.media_type, headers=headers)


def _content(store: PlanStore, image: PlanImage) -> bytes | None:
    try:
        return store.content(image)
    except OSError as error:
        raise ProblemError(
            Kind.NOT_SAVED, say("plan_unreadable", "The image cannot be read: {why}.", why=error.strerror or error)
        ) from error
