"""QR codes as SVG."""

import io

import segno

SVG = "image/svg+xml"


def qr_code(text: str) -> bytes:
    """Return the code of a text, such as a link that a phone opens."""
    written = io.BytesIO()
    segno.make(text, error="l").save(written, kind="svg", scale=4, border=4, dark="black", light="white")
    return written.getvalue()
