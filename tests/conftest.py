"""Fixtures that every part of the suite may use."""

from collections.abc import Iterator

import pytest
from hypothesis import settings

from support.kernel_cache import use_cache_of_these_sources
from support.zenoh_router import free_endpoint, running_router

use_cache_of_these_sources()
settings.register_profile("house", deadline=None)  # machines that run tests are slow now and then
settings.load_profile("house")


@pytest.fixture
def router_endpoint() -> Iterator[str]:
    """The endpoint of a Zenoh router that runs as long as the test."""
    endpoint = free_endpoint()
    with running_router(endpoint):
        yield endpoint
