"""Services here are started with a limit on the time they may take, which leaves none for compiling the estimator."""

import pytest

from support.kernel_cache import compile_once


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    compile_once()
