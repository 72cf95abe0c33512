"""Check with schemathesis that the omlox interface follows its own OpenAPI document."""

import pytest
from fastapi import FastAPI
from schemathesis.specs.openapi.checks import positive_data_acceptance

from support.contract import assert_follows_the_document, operations_of
from support.events import circle
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


def app() -> FastAPI:
    bench = OmloxBench()
    bench.poses.move("tag-1", "a")
    bench.zones.put(circle("dock"))
    return bench.app


OPERATIONS = operations_of(app(), "/omlox/v2/openapi.json")


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_response_follows_the_document(name: str) -> None:
    may_refuse = name in REFUSES_VALID or "{" in OPERATIONS[name].path or name.startswith("put_")
    assert_follows_the_document(OPERATIONS[name], [positive_data_acceptance] if may_refuse else [])
