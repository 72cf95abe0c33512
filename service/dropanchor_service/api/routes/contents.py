"""Contents of requests and responses in the OpenAPI document."""

from collections.abc import Iterable

from pydantic import BaseModel
from starlette.responses import StreamingResponse

TEXT = {"schema": {"type": "string"}}
BYTES = {"schema": {"type": "string", "format": "binary"}}


def schema_of(model: type[BaseModel]) -> dict[str, str]:
    """Return what leads to a model of the document."""
    return {"$ref": f"#/components/schemas/{model.__name__}"}


def file_response(content: Iterable[bytes], name: str, media_type: str) -> StreamingResponse:
    """Return a file that a browser saves under this name."""
    headers = {"cache-control": "no-store", "content-disposition": f'attachment; filename="{name}"'}
    return StreamingResponse(content, media_type=media_type, headers=headers)
