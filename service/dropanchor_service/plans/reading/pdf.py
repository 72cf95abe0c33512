"""Draw a page of a PDF."""

import math
from contextlib import closing

from PIL import Image
from pypdfium2 import PdfDocument, PdfiumError
from pypdfium2.raw import FPDF_ERR_PASSWORD

from dropanchor_schemas.sentences import say
from dropanchor_service.plans.reading.refused import RefusedError

_DOTS_PER_POINT = 200 / 72
_MAX_PIXELS = 16e6
_MAX_SIDE_PX = 8000.0


def drawn_page(content: bytes, number: int) -> tuple[Image.Image, int]:
    """Return a page, counted from 1, at 200 dots per inch or fewer, and the number of pages. Raises RefusedError."""
    try:
        with closing(PdfDocument(content)) as document:
            return _drawn(document, number), len(document)
    except PdfiumError as error:
        if error.err_code == FPDF_ERR_PASSWORD:
            raise RefusedError(say("pdf_encrypted", "the PDF is encrypted. Save it without a password")) from error
        raise RefusedError(say("pdf_damaged", "the PDF is damaged")) from error


def _drawn(document: PdfDocument, number: int) -> Image.Image:
    pages = len(document)
    if not 1 <= number <= pages:
        raise RefusedError(
            say("pdf_pages", "the PDF has {pages} pages, and page {page} was asked for", pages=pages, page=number)
        )
    page = document[number - 1]
    image: Image.Image = page.render(scale=_scale_of(*page.get_size())).to_pil()
    return image.convert("RGB")


def _scale_of(width_pt: float, height_pt: float) -> float:
    """Return the pixels per point that keep the image within the limits. Raises RefusedError for an empty page."""
    if width_pt < 1 or height_pt < 1:
        raise RefusedError(say("pdf_empty", "the page of the PDF has no area"))
    return min(
        _DOTS_PER_POINT, math.sqrt(_MAX_PIXELS / (width_pt * height_pt)), _MAX_SIDE_PX / max(width_pt, height_pt)
    )
