"""Turn an uploaded file into an image that browsers show."""

from PIL import Image

from dropanchor_schemas.plans import ImageType, Placement
from dropanchor_schemas.pose import Phrase
from dropanchor_schemas.sentences import said_by, say
from dropanchor_service.plans.reading.file_types import JPEG, PDF, SVG
from dropanchor_service.plans.reading.ground import UnplacedError, affine_of_tiff, affine_of_world_file, placement_of
from dropanchor_service.plans.reading.messages import Description, ReadPlan, Request
from dropanchor_service.plans.reading.raster import encoded, open_image, pixels_of
from dropanchor_service.plans.reading.refused import RefusedError


def read_plan(content: bytes, request: Request) -> ReadPlan:
    """Return the image in a file. Raises RefusedError."""
    try:
        if request.media_type == PDF:
            return _read_pdf(content, request)
        return _read_svg(content) if request.media_type == SVG else _read_raster(content, request)
    except ModuleNotFoundError as error:
        raise RefusedError(
            say("no_drawing", "PDF and SVG need the extra `maps`: pip install 'dropanchor-service[maps]'")
        ) from error


def _read_svg(content: bytes) -> ReadPlan:
    from dropanchor_service.plans.reading.svg import drawn_svg

    png, (width, height), lack = drawn_svg(content)
    note, phrase = (lack, Phrase.of(lack)) if lack else ("", None)
    return ReadPlan(Description(width_px=width, height_px=height, note=note, note_phrase=phrase), png)


def _read_pdf(content: bytes, request: Request) -> ReadPlan:
    from dropanchor_service.plans.reading.pdf import drawn_page

    image, pages = drawn_page(content, request.page)
    return ReadPlan(
        Description(media_type="image/png", width_px=image.width, height_px=image.height, pages=pages),
        encoded(image, "image/png"),
    )


def _read_raster(content: bytes, request: Request) -> ReadPlan:
    opened = open_image(content, request.media_type)
    image = pixels_of(opened)
    placement, note = _placed(opened, request)
    kind: ImageType = "image/jpeg" if request.media_type == JPEG else "image/png"
    description = Description(
        media_type=kind,
        width_px=image.width,
        height_px=image.height,
        placement=placement,
        note=note,
        note_phrase=Phrase.of(note),
    )
    return ReadPlan(description, encoded(image, kind))


def _placed(image: Image.Image, request: Request) -> tuple[Placement | None, str]:
    """Return where an image lies, or why that is not known; an empty reason if it says nothing about it."""
    found = affine_of_tiff(image)
    affine, crs = found if found is not None else (None, "")
    if request.world is not None:
        affine, crs = affine_of_world_file(request.world), ""
    if affine is None:
        return None, ""
    try:
        return placement_of(affine, image.size, request.crs or crs, request.georeference), ""
    except UnplacedError as error:
        return None, said_by(error)
