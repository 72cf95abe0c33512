"""Compile the kernels before anything is measured."""

import pytest

from support.kernel_cache import compile_once


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    compile_once()
