"""Read PNG, JPEG and TIFF, and write what browsers show: PNG or JPEG, without metadata."""

from io import BytesIO

from PIL import Image, ImageOps, UnidentifiedImageError

from dropanchor_schemas.plans import MAX_SIDE_PX
from dropanchor_schemas.sentences import said_by, say
from dropanchor_service.plans.reading.file_types import JPEG, PNG, TIFF
from dropanchor_service.plans.reading.refused import RefusedError

MAX_MEGAPIXELS = 40

_FORMATS = {PNG: "PNG", JPEG: "JPEG", TIFF: "TIFF"}
_KEPT_MODES = ("1", "L", "LA", "P", "RGB", "RGBA")
_DEEP_MODES = ("I", "I;16", "I;16B", "I;16L", "F")
_JPEG_QUALITY = 90


def open_image(content: bytes, media_type: str) -> Image.Image:
    """Return the image, whose pixels are not read yet. Raises RefusedError."""
    Image.MAX_IMAGE_PIXELS = None  # the limit is ours
    try:
        image = Image.open(BytesIO(content), formats=[_FORMATS[media_type]])
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise RefusedError(say("plan_damaged", "the image is damaged: {why}", why=said_by(error))) from error
    require_size(*image.size)
    if image.mode in _DEEP_MODES:
        raise RefusedError(
            say("plan_deep", "its pixels are measurements, not colours. Save the picture with 8 bits per channel")
        )
    return image


def require_size(width: int, height: int) -> None:
    """Raise RefusedError for an image that is too large."""
    megapixels = width * height / 1e6
    if megapixels > MAX_MEGAPIXELS:
        raise RefusedError(
            say(
                "plan_pixels",
                "the image has {width} × {height} pixels, {megapixels} megapixels. At most {most} are "
                "allowed: make it smaller",
                width=width,
                height=height,
                megapixels=f"{megapixels:.0f}",
                most=MAX_MEGAPIXELS,
            )
        )
    if max(width, height) > MAX_SIDE_PX:
        raise RefusedError(
            say(
                "plan_side",
                "the image has a side of {side} pixels. At most {most} are allowed",
                side=max(width, height),
                most=MAX_SIDE_PX,
            )
        )


def pixels_of(image: Image.Image) -> Image.Image:
    """Return the image turned as its metadata says, in colours that browsers show. Raises RefusedError."""
    try:
        turned = ImageOps.exif_transpose(image)
        return turned if turned.mode in _KEPT_MODES else turned.convert("RGB")
    except (OSError, SyntaxError, ValueError) as error:
        raise RefusedError(say("plan_damaged", "the image is damaged: {why}", why=said_by(error))) from error


def encoded(image: Image.Image, media_type: str) -> bytes:
    """Return the file of an image. media_type: PNG or JPEG."""
    file = BytesIO()
    image.info = {key: image.info[key] for key in ("transparency",) if key in image.info}
    image.save(file, _FORMATS[media_type], **({"quality": _JPEG_QUALITY} if media_type == JPEG else {}))
    return file.getvalue()
