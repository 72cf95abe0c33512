"""Fixtures that every part of the suite may use."""

from collections.abc import Iterator

import pytest
from hypothesis import settings

from support.kernel_cache import use_cache_of_these_sources
from support.zenoh_router import free_endpoint, running_router

use_cache_of_these_sources()
settings.register_profile("house", deadline=None)  # machines that run tests are slow now and then
settings.load_profile("house")

# Of two workers the first one fills the cache of kernels while the other runs what needs none of them.
FIRST = ("benchmarks", "schemas", "tag_client")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=_turn)


def _turn(item: pytest.Item) -> int:
    folder = item.path.relative_to(item.config.rootpath / "tests").parts[0]
    return FIRST.index(folder) if folder in FIRST else len(FIRST)


@pytest.fixture
def router_endpoint() -> Iterator[str]:
    """The endpoint of a Zenoh router that runs as long as the test."""
    endpoint = free_endpoint()
    with running_router(endpoint):
        yield endpoint
