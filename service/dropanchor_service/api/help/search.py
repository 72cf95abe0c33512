"""Search the documentation: the pages with all words, those with the words in their titles first."""

import re
from dataclasses import dataclass
from functools import cache
from html import escape

from dropanchor_service.api.help.documents import START, documents, title_of
from dropanchor_service.api.help.rendering import frame

MAX_WORDS = 8
MAX_SHOWN = 20
_MARKS = re.compile(r"<!--.*?-->|\]\([^)]*\)|[`*|#\[\]]+", re.DOTALL)


@dataclass(frozen=True)
class _Page:
    """lower: the text to search, without marks of Markdown."""

    path: str
    title: str
    text: str
    lower: str


def results(asked: str) -> str:
    """Return the HTML of the page that lists what was found."""
    words = asked.lower().split()[:MAX_WORDS]
    found = [page for page in _pages() if all(word in page.lower for word in words)]
    found.sort(key=lambda page: _rank(words, page))
    lines = "".join(
        f'<li><a href="{page.path}">{escape(page.title)}</a><p>{escape(_line(words, page.text))}</p></li>'
        for page in found[:MAX_SHOWN]
    )
    heading = f"<h1>{len(found)} {'page' if len(found) == 1 else 'pages'} with “{escape(asked)}”</h1>"
    return frame(START, f"Search: {asked}", f'{heading}<ul class="found">{lines}</ul>', asked)


def _rank(words: list[str], page: _Page) -> tuple[int, bool, int]:
    in_title = sum(word in page.title.lower() for word in words)
    return -in_title, page.path.startswith("decisions/"), -sum(page.lower.count(word) for word in words)


def _line(words: list[str], text: str) -> str:
    """Return the line with the most of the words: at most 200 characters, from shortly before the first of them."""
    line = max(text.splitlines(), key=lambda one: sum(word in one.lower() for word in words))
    first = min((place for word in words if (place := line.lower().find(word)) >= 0), default=0)
    start = max(0, first - 80)
    return f"{'…' if start else ''}{line[start : start + 200].strip()}"


@cache
def _pages() -> list[_Page]:
    texts = {path: _MARKS.sub(" ", text) for path, text in documents().items()}
    return [_Page(path, title_of(documents()[path]), text, text.lower()) for path, text in texts.items()]
