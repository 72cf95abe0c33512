"""Draw an SVG. One that needs another file is refused: the drawing would lack it."""

import re
from collections.abc import Iterator
from io import BytesIO
from xml.etree import ElementTree

from PIL import Image
from resvg_py import svg_to_bytes

from dropanchor_schemas.sentences import Sentence, said_by, say
from dropanchor_service.plans.reading.refused import RefusedError

LONGER_SIDE_PX = 4096  # the page shows no more

_SVG = "{http://www.w3.org/2000/svg}"
_HREFS = ("href", "{http://www.w3.org/1999/xlink}href")
_WITHIN = re.compile(r"#|data:image/(?:png|jpeg);base64,")  # images within images could refer to files again
_REFERENCE = re.compile(r"(?:url\s*\(|@import)\s*(.{0,40})", re.IGNORECASE | re.DOTALL)
_DOTS_PER_INCH = 96.0  # of CSS
_LETTER = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><text y="9">m</text></svg>'
_NO_FONT = say(
    "svg_no_font",
    "no font is installed where the service runs, so the plan lacks its texts: install one, such as Debian's "
    "package fonts-dejavu-core, and upload the plan again",
)


def drawn_svg(content: bytes) -> tuple[bytes, tuple[int, int], Sentence | None]:
    """Return a drawing as PNG, its width and height in pixels, and what it lacks. Raises RefusedError."""
    root = _read(content)
    for file in _references(root):
        raise RefusedError(
            say(
                "svg_file",
                "the SVG refers to another file: {file}. Embed what it needs when you save it, "
                "or save it as PNG or PDF",
                file=repr(file[:80]),
            )
        )
    try:
        png = _png(ElementTree.tostring(root, encoding="unicode"), LONGER_SIDE_PX)
    except ValueError as error:
        raise RefusedError(
            say("svg_undrawn", "the SVG cannot be drawn: {why}. Save it as PNG or PDF", why=said_by(error).rstrip("."))
        ) from error
    lacks_texts = root.find(f".//{_SVG}text") is not None and not Image.open(BytesIO(_png(_LETTER, 9))).getbbox()
    return png, Image.open(BytesIO(png)).size, _NO_FONT if lacks_texts else None


def _read(content: bytes) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise RefusedError(say("svg_damaged", "the SVG is damaged: {why}", why=said_by(error))) from error
    if root.tag != f"{_SVG}svg":
        raise RefusedError(say("svg_other", "the file is XML, but no SVG"))
    return root


def _references(root: ElementTree.Element) -> Iterator[str]:
    """Yield the other files that elements, attributes and styles name."""
    for element in root.iter():
        hrefs = [element.get(name, "#").strip() for name in _HREFS] if element.tag != f"{_SVG}a" else []
        yield from (href for href in hrefs if not _WITHIN.match(href))
        for text in (*element.attrib.values(), element.text or ""):
            yield from (found for found in _REFERENCE.findall(text) if not found.lstrip("'\"").startswith("#"))


def _png(drawing: str, longer_side_px: int) -> bytes:
    """Return a drawing as PNG. Raises ValueError."""
    return svg_to_bytes(svg_string=drawing, width=longer_side_px, height=longer_side_px, dpi=_DOTS_PER_INCH)
