"""Through two API nodes before three owners, every site's part of the interface follows its OpenAPI document, too."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from fastapi import FastAPI

from support.api_nodes import BareNode, running_owner
from support.contract import Operation, assert_follows_the_document, operations_of
from support.interface_document import DOCUMENT, operation_ids
from support.rest_contract import BEYOND_THE_SCHEMA, OF_SITE, contract_app

BUCKETS = ("017", "018", "019")
EXAMPLES = 2  # of each kind: the owners' own tests ask for more
NAMES = list(operation_ids(DOCUMENT))
OF_ALL = ["list_sites", "list_poses_of_sites", "get_live", "get_ready"]
ASKED = [*OF_ALL, *(name for name in NAMES if name.endswith(OF_SITE))]


@pytest.fixture(scope="module")
def apps(tmp_path_factory: pytest.TempPathFactory) -> dict[str, FastAPI]:
    folder = tmp_path_factory.mktemp("sites")
    return {bucket: contract_app(folder / bucket, f"{bucket}.yard") for bucket in BUCKETS}


@pytest.fixture(scope="module")
def operations(apps: dict[str, FastAPI]) -> dict[str, Operation]:
    return operations_of(apps["017"], "/api/v1/openapi.json", NAMES, over_http=True)


@pytest.fixture(scope="module")
def places(apps: dict[str, FastAPI]) -> Iterator[list[tuple[str, str]]]:
    with ExitStack() as opened:
        owners = [opened.enter_context(running_owner(app, bucket)) for bucket, app in apps.items()]
        nodes = [opened.enter_context(BareNode().running(*owners)) for _ in range(2)]
        yield [(node, f"{bucket}.yard") for bucket in BUCKETS for node in nodes]


@pytest.mark.parametrize("name", ASKED)
def test_every_response_follows_the_document(
    name: str, operations: dict[str, Operation], places: list[tuple[str, str]]
) -> None:
    excluded = BEYOND_THE_SCHEMA.get(name.removesuffix(OF_SITE), [])
    of_site = places if name.endswith(OF_SITE) else [(node, "") for node, _ in places]
    assert_follows_the_document(operations[name], excluded, EXAMPLES, of_site)
