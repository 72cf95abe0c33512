"""Render a page of the documentation. HTML in the Markdown is shown as text, so no page can bring a script."""

import re
from functools import lru_cache
from html import escape
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.token import Token

from dropanchor_service.api.help.documents import contents, documents, title_of


@lru_cache(maxsize=256)
def page(path: str) -> str:
    """Return the HTML of a page. Raises KeyError when there is none at the path."""
    text = documents()[path]
    body = _markdown().render(text).replace("<pre>", '<pre tabindex="0">')  # to scroll it by keyboard
    return frame(path, title_of(text), body)


def frame(path: str, title: str, body: str, asked: str = "") -> str:
    """Return a whole page around a body of HTML. path: of the page, to which its links are relative."""
    up = "../" * path.count("/")
    label = "Search the documentation"
    return f"""<!doctype html>
<html lang="en">
<head>
  <meta charset="utf-8">
  <meta name="viewport" content="width=device-width, initial-scale=1">
  <meta name="color-scheme" content="light dark">
  <title>{escape(title)} · Dropanchor</title>
  <link rel="icon" href="{up}../icon.svg" type="image/svg+xml">
  <link rel="stylesheet" href="{up}../css/help.css">
</head>
<body>
  <header>
    <a href="{up or "./"}">Dropanchor documentation</a>
    <form action="{up or "./"}" role="search">
      <input type="search" name="q" value="{escape(asked)}" maxlength="100" aria-label="{label}" required>
      <button>Search</button>
    </form>
  </header>
  <main>{body}</main>
  <nav aria-label="Contents">{_contents(path, up)}</nav>
</body>
</html>
"""


def _contents(path: str, up: str) -> str:
    parts = []
    for name, entry in contents().items():
        if isinstance(entry, str):
            parts.append(f"<p>{_link(name, entry, path, up)}</p>")
            continue
        lines = "".join(f"<li>{_link(title, one, path, up)}</li>" for title, one in entry.items())
        is_open = " open" if path in entry.values() else ""
        parts.append(f"<details{is_open}><summary>{escape(name)}</summary><ul>{lines}</ul></details>")
    return "".join(parts)


def _link(title: str, to: str, path: str, up: str) -> str:
    here = ' aria-current="page"' if to == path else ""
    return f'<a href="{up}{to}"{here}>{escape(title)}</a>'


def _markdown() -> MarkdownIt:
    markdown = MarkdownIt("commonmark", {"html": True}).enable("table")
    markdown.core.ruler.push("names_of_headings", _name_headings)
    markdown.add_render_rule("html_block", _html)
    markdown.add_render_rule("html_inline", _html)
    markdown.add_render_rule("table_open", lambda *_: '<div class="scroll" tabindex="0"><table>')
    markdown.add_render_rule("table_close", lambda *_: "</table></div>")
    return markdown


def _html(_self: Any, tokens: list[Token], index: int, *_: Any) -> str:
    """Return HTML of the Markdown as text. Comments are for the authors."""
    content = tokens[index].content
    return "" if content.lstrip().startswith("<!--") else escape(content)


def _name_headings(state: Any) -> None:
    """Give headings the names that links in the pages use, which are those of code hosts."""
    for heading, inline in zip(state.tokens, state.tokens[1:], strict=False):
        if heading.type == "heading_open":
            words = re.sub(r"[^\w\- ]", "", inline.content.lower())
            heading.attrSet("id", words.replace(" ", "-"))
