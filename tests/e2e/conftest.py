"""The services in these tests must start within a time limit, so the kernels are compiled before."""

import pytest

from support.kernel_cache import compile_once


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    compile_once()
