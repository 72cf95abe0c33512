"""Check with schemathesis that the interface follows its OpenAPI document, for valid and invalid requests."""

import pytest

from support.contract import Operation, assert_follows_the_document, operations_of
from support.interface_document import DOCUMENT, operation_ids
from support.rest_contract import BEYOND_THE_SCHEMA, OF_SITE, contract_app

NAMES = list(operation_ids(DOCUMENT))
ASKED = [name for name in NAMES if not name.endswith(OF_SITE)] + ["get_pose_of_site", "put_anchor_of_site"]
"""Below a site the same functions answer, so two of them are enough."""


@pytest.fixture(scope="module")
def operations(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Operation]:
    return operations_of(contract_app(tmp_path_factory.mktemp("site")), "/api/v1/openapi.json", NAMES)


@pytest.mark.parametrize("name", ASKED)
def test_every_response_follows_the_document(name: str, operations: dict[str, Operation]) -> None:
    assert_follows_the_document(operations[name], BEYOND_THE_SCHEMA.get(name.removesuffix(OF_SITE), []))
