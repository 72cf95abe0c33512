"""The OpenAPI document of the interface as it is committed: `test_edges.py` sees that the service returns the same."""

import json
from collections.abc import Iterator
from typing import Any

from dropanchor_service.api.export import FILE

DOCUMENT: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
SCHEMAS: dict[str, Any] = DOCUMENT["components"]["schemas"]


def operation_ids(document: dict[str, Any]) -> Iterator[str]:
    """Yield the ids of the operations of an OpenAPI document."""
    for item in document["paths"].values():
        for operation in item.values():
            yield operation["operationId"]
