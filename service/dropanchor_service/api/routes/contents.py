"""Contents of requests and responses in the OpenAPI document."""

from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from typing import Any

from pydantic import BaseModel
from starlette.responses import StreamingResponse

from dropanchor_service.answers.answers import to_json

TEXT = {"schema": {"type": "string"}}
BYTES = {"schema": {"type": "string", "format": "binary"}}


def schema_of(model: type[BaseModel]) -> dict[str, str]:
    """Return what leads to a model of the document."""
    return {"$ref": f"#/components/schemas/{model.__name__}"}


LINES: dict[int | str, Any] = {200: {"content": {"application/jsonl": TEXT, "text/csv": TEXT}}}
"""The response of a route that returns a file of lines."""


def lines_response(
    name: str,
    pages: Iterator[list[Any]],
    to_csv: Callable[[Iterable[Any]], Iterator[bytes]] | None,
    encoded: Callable[[Any], bytes] = to_json,
) -> StreamingResponse:
    """Return the entries of all pages as CSV or, without `to_csv`, as JSON lines. Raises what the first page raises.

    encoded: returns an entry as JSON.
    """
    entries = chain(next(pages), chain.from_iterable(pages))
    if to_csv is not None:
        return file_response(to_csv(entries), f"{name}.csv", "text/csv")
    return file_response((encoded(entry) + b"\n" for entry in entries), f"{name}.jsonl", "application/jsonl")


def file_response(content: Iterable[bytes], name: str, media_type: str) -> StreamingResponse:
    """Return a file that a browser saves under this name."""
    headers = {"cache-control": "no-store", "content-disposition": f'attachment; filename="{name}"'}
    return StreamingResponse(content, media_type=media_type, headers=headers)
