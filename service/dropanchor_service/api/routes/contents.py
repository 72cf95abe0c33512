"""Contents of requests and responses in the OpenAPI document."""

from pydantic import BaseModel

TEXT = {"schema": {"type": "string"}}
BYTES = {"schema": {"type": "string", "format": "binary"}}


def schema_of(model: type[BaseModel]) -> dict[str, str]:
    """Return what leads to a model of the document."""
    return {"$ref": f"#/components/schemas/{model.__name__}"}
