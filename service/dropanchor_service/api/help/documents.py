"""The files of the documentation. Here the service and the site of `make docs` agree on their order and their links."""

import posixpath
import re
from collections.abc import Container
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parents[2]
FOLDER = next(
    (folder for folder in (_PACKAGE / "docs", _PACKAGE.parent / "docs") if (folder / "tutorial.md").is_file()),
    _PACKAGE / "docs",
)
"""Inside the package when it was installed from a wheel, beside it in a checkout."""
START = "README.md"
SECTIONS = {"How-to guides": "how-to", "Reference": "reference", "Explanation": "explanation", "Results": "results"}
ALONE = {"Tutorial": "tutorial.md", "Decisions": "decisions/README.md"}
"""Pages that the contents list by themselves. The first of them comes before the sections."""

_TITLE = re.compile(r"^# (.+)$", re.MULTILINE)
_LINK = re.compile(r"\[(?P<text>[^\]]*)\]\((?P<target>[^)#:\s]+)(?:#[^)\s]*)?\)")


@cache
def documents() -> dict[str, str]:
    """Return the Markdown of each page, by its path in the folder. A link that leaves the folder is only text in it."""
    files = sorted(FOLDER.rglob("*.md"))
    paths = {file.relative_to(FOLDER).as_posix(): file for file in files}
    return {path: without_links_outside(path, file.read_text("utf-8"), paths) for path, file in paths.items()}


def without_links_outside(page: str, text: str, pages: Container[str]) -> str:
    """Return the Markdown of a page with the links alone that lead to one of the pages, or to the network."""

    def kept(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(page), link["target"]))
        return link[0] if target in pages else link["text"]

    return _LINK.sub(kept, text)


def title_of(text: str) -> str:
    """Return the first heading of a page, without marks of code."""
    found = _TITLE.search(text)
    return found[1].replace("`", "") if found else ""


@cache
def contents() -> dict[str, str | dict[str, str]]:
    """Return the paths of the pages by their titles, in the order of the contents: of a section, or of a page alone."""
    titles = {path: title_of(text) for path, text in documents().items()}
    sections = {
        name: {titles[path]: path for path in sorted(titles, key=titles.__getitem__) if path.startswith(f"{folder}/")}
        for name, folder in SECTIONS.items()
    }
    first, *rest = ALONE.items()
    return dict([first, *sections.items(), *rest])
