"""The attribution of a base map: text with links, from HTML that others have written."""

import re
from html.parser import HTMLParser

from dropanchor_schemas.basemap import Credit

MAX_HTML = 10_000
MAX_PARTS = 20
MAX_TEXT = 200
MAX_LINK = 500


def credits_in(html: str) -> list[Credit]:
    """Return the text and the web links in HTML. Everything else in it is left out."""
    reader = _Reader()
    reader.feed(html[:MAX_HTML])
    reader.close()
    return reader.found[:MAX_PARTS] if any(part.text.strip() for part in reader.found) else []


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.found: list[Credit] = []
        self._link: str | None = None
        self._is_hidden = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "a":
            link = dict(attrs).get("href") or ""
            self._link = link if link.startswith(("https://", "http://")) and len(link) <= MAX_LINK else None
        self._is_hidden = tag in ("script", "style")

    def handle_endtag(self, tag: str) -> None:
        if tag == "a":
            self._link = None
        self._is_hidden = False

    def handle_data(self, data: str) -> None:
        text = re.sub(r"\s+", " ", data)[:MAX_TEXT]
        if text and not self._is_hidden:
            self.found.append(Credit(text=text, link=self._link))
