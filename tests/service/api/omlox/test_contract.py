"""Check with schemathesis that the omlox interface follows its own OpenAPI document."""

import pytest
from schemathesis.specs.openapi.checks import positive_data_acceptance

from dropanchor_service.api.export import omlox_document
from support.contract import Operation, assert_follows_the_document, operations_of
from support.events import circle
from support.interface_document import operation_ids
from support.omlox import OmloxBench

REFUSES_VALID = (
    "create_fence",
    "create_provider",
    "create_trackable",
    "list_fences",
    "list_locations",
    "list_motions",
)
"""A schema cannot express that a fence has no holes and lies near the site, which names a tag may have, and that
GeoJSON is never `local`. Beside these, whatever names an object may name one that does not exist."""


NAMES = list(operation_ids(omlox_document()))


@pytest.fixture(scope="module")
def operations() -> dict[str, Operation]:
    bench = OmloxBench()
    bench.poses.move("tag-1", "a")
    bench.zones.put(circle("dock"))
    return operations_of(bench.app, "/omlox/v2/openapi.json", NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_response_follows_the_document(name: str, operations: dict[str, Operation]) -> None:
    may_refuse = name in REFUSES_VALID or "{" in operations[name].path or name.startswith("put_")
    assert_follows_the_document(operations[name], [positive_data_acceptance] if may_refuse else [])
