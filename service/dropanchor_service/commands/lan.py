"""Show the addresses at which other devices reach the page, and a QR code for a phone."""

from typing import TextIO

import segno

from dropanchor_service.runtime.own_addresses import urls_for_others


def show_addresses(url: str, out: TextIO) -> None:
    """Write the addresses of the page for other devices, if it has any.

    url: where the service listens; its host may stand for all interfaces. A terminal also gets a QR code of the first.
    """
    urls = list(urls_for_others(url))
    if not urls:
        return
    out.write("".join(f"the page for other devices: {each}/\n" for each in urls))
    if out.isatty():
        segno.make(f"{urls[0]}/", error="l").terminal(out=out, border=2, compact=True)
        out.write(f"Scan the code with a phone to open {urls[0]}/\n")
    out.flush()
