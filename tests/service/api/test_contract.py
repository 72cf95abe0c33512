"""Check with schemathesis that the interface follows its OpenAPI document, for valid and invalid requests."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from support.contract import assert_follows_the_document, operations_of
from support.rest_contract import BEYOND_THE_SCHEMA, OF_SITE, contract_app

FOLDER = TemporaryDirectory(prefix="dropanchor-contract-")  # deleted together with the module
OPERATIONS = operations_of(contract_app(Path(FOLDER.name)), "/api/v1/openapi.json")
ASKED = [name for name in OPERATIONS if not name.endswith(OF_SITE)] + ["get_pose_of_site", "put_anchor_of_site"]
"""Below a site the same functions answer, so two of them are enough."""


@pytest.mark.parametrize("name", ASKED)
def test_every_response_follows_the_document(name: str) -> None:
    assert_follows_the_document(OPERATIONS[name], BEYOND_THE_SCHEMA.get(name.removesuffix(OF_SITE), []))
