"""The page of the REST interface, from the OpenAPI document."""

from typing import Any

from dropanchor_service.api.http.errors import Kind
from dropanchor_service.reference.markdown import table

_INTRODUCTION = """\
# REST interface

The base path is `/api/v1`. The whole document, with every field, lies at `/api/v1/openapi.json` and in
`schemas/dropanchor_schemas/openapi.json`. SI units and radians; a heading counts counter-clockwise from east; times
are UTC in ns. With credentials, every request but those for health and the document itself carries
`Authorization: Bearer KEY`.
"""


def page(document: dict[str, Any]) -> str:
    """Return the page as Markdown. document: OpenAPI 3.1."""
    groups = [tag["name"] for tag in document["tags"]]
    sections = [_INTRODUCTION]
    for group in groups:
        rows = [_row(path, method, operation) for path, method, operation in _operations(document, group)]
        header = ("request", "answer", "query parameters", "status codes")
        sections.append(f"## {group.capitalize()}\n\n{table(header, rows)}")
    kinds = ((f"`{kind.type}`", str(kind.status), kind.title) for kind in Kind)
    sections.append(
        "## Errors\n\nEvery error is `application/problem+json` (RFC 9457) of one of these types:\n\n"
        + table(("type", "status", "title"), kinds)
    )
    return "\n".join(sections)


def _operations(document: dict[str, Any], group: str) -> list[tuple[str, str, dict[str, Any]]]:
    return [
        (path, method, operation)
        for path, operations in document["paths"].items()
        for method, operation in operations.items()
        if group in operation.get("tags", [])
    ]


def _row(path: str, method: str, operation: dict[str, Any]) -> tuple[str, str, str, str]:
    query = [f"`{parameter['name']}`" for parameter in operation.get("parameters", []) if parameter["in"] == "query"]
    return f"`{method.upper()} {path}`", operation["summary"], ", ".join(query), ", ".join(operation["responses"])
