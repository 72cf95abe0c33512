"""The site of `make docs` has the contents and the links of the pages that the service serves below `/help`."""

from typing import Any

from dropanchor_service.api.help.documents import START, contents, documents


def on_config(config: Any) -> None:
    """Give the site the contents that the service shows."""
    entries = contents().items()
    lists = {name: [{title: path} for title, path in one.items()] for name, one in entries if isinstance(one, dict)}
    config["nav"] = [START, *({name: lists.get(name, one)} for name, one in entries)]


def on_page_markdown(_markdown: str, page: Any, **_: Any) -> str:
    """Return the page without links to files of the repository that are no pages."""
    return documents()[page.file.src_path]
