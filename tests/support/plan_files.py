"""Files that people upload as floor plans, good and bad."""

from contextlib import closing
from io import BytesIO
from typing import Any

from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from pypdfium2 import PdfDocument

DOUBLE, SHORT = 12, 3


def image_file(width: int = 40, height: int = 20, kind: str = "PNG", mode: str = "RGB", **options: Any) -> bytes:
    """Return an image whose left half is red and whose right half is blue, where the mode has colours."""
    image = Image.new(mode, (width, height), "red" if mode == "RGB" else 0)
    if mode == "RGB":
        image.paste("blue", (width // 2, 0, width, height))
    file = BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


def svg_file(inside: str = '<rect width="50" height="50"/>', attributes: str = 'viewBox="0 0 100 50"') -> bytes:
    return f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}>{inside}</svg>'.encode()


def pdf_file(*sizes: tuple[float, float]) -> bytes:
    """Return a PDF with empty pages of these sizes in points."""
    file = BytesIO()
    with closing(PdfDocument.new()) as document:
        for size in sizes:
            document.new_page(*size)
        document.save(file)
    return file.getvalue()


def encrypted_pdf_file() -> bytes:
    """Return a PDF whose trailer says that it needs a password."""
    key = "00" * 32
    encrypt = f"/Encrypt << /Filter /Standard /V 1 /R 2 /P -4 /O <{key}> /U <{key}> >> /ID [<00> <00>]"
    head, _, tail = pdf_file((100, 100)).rpartition(b"trailer")
    return head + b"trailer" + tail.replace(b"<<", f"<< {encrypt}".encode(), 1)


def geotiff_file(
    width: int,
    height: int,
    corner: tuple[float, float],
    m_per_px: float,
    epsg: int | None = 25833,
    is_point: bool = False,
) -> bytes:
    """Return a GeoTIFF whose first pixel has its corner there; with is_point, its centre. epsg: None: it names none."""
    tags = ImageFileDirectory_v2()
    tags.tagtype[33550] = tags.tagtype[33922] = DOUBLE
    tags.tagtype[34735] = SHORT
    tags[33550] = (m_per_px, m_per_px, 0.0)
    tags[33922] = (0.0, 0.0, 0.0, *corner, 0.0)
    tags[34735] = (1, 1, 0, 2, 1025, 0, 1, 2 if is_point else 1, 3072, 0, 1, 32767 if epsg is None else epsg)
    return image_file(width, height, "TIFF", tiffinfo=tags)
