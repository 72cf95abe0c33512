"""Tell the type of a file by its content."""

from dropanchor_schemas.sentences import say
from dropanchor_service.plans.reading.refused import RefusedError

PNG, JPEG, TIFF, PDF, SVG = "image/png", "image/jpeg", "image/tiff", "application/pdf", "image/svg+xml"
UNDECLARED = ("", "application/octet-stream")

_BEGINNINGS = {
    b"\x89PNG\r\n\x1a\n": PNG,
    b"\xff\xd8\xff": JPEG,
    b"II*\0": TIFF,
    b"MM\0*": TIFF,
    b"II+\0": TIFF,
    b"MM\0+": TIFF,
}
_PDF_WITHIN = 1024  # bytes; a PDF may begin with something else
_READABLE = "PNG, JPEG, SVG, PDF or GeoTIFF"


def file_type_of(content: bytes, declared: str) -> str:
    """Return the media type of a file. declared: what the client says. Raises RefusedError when that is not true."""
    found = _found_type(content)
    if found is None:
        raise RefusedError(say("plan_kind", "the file is none that can be read here. Use {kinds}", kinds=_READABLE))
    stated = declared.partition(";")[0].strip().lower().replace("image/jpg", JPEG)
    if stated not in (found, *UNDECLARED):
        raise RefusedError(
            say(
                "plan_other_kind",
                "the file is said to be {stated}, but its content is {found}",
                stated=stated[:64],
                found=found,
            )
        )
    return found


def _found_type(content: bytes) -> str | None:
    for beginning, media_type in _BEGINNINGS.items():
        if content.startswith(beginning):
            return media_type
    if b"%PDF-" in content[:_PDF_WITHIN]:
        return PDF
    return SVG if content[:_PDF_WITHIN].removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<") else None
