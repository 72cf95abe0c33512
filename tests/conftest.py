"""Set-up and fixtures for the whole suite."""

import gc
import os
import signal
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from support.kernel_cache import use_cache_of_these_sources
from support.outside import is_left_out, is_long, is_outside
from support.patience import be_patient_with_http
from support.zenoh_router import free_endpoint, running_router

use_cache_of_these_sources()
be_patient_with_http()
# Without compiled modules each of the hundreds of programs that the tests start would compile all of them again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# A shell without job control makes what it starts in the background ignore Ctrl-C, and so would the programs of tests.
signal.signal(signal.SIGINT, signal.default_int_handler)
settings.register_profile("dropanchor", deadline=None)  # test machines are slow at times
settings.load_profile("dropanchor")

# One worker runs these tests, which need no kernels, while another one fills the kernel cache.
FIRST = ("benchmarks", "schemas", "tag_client")
WAITING = ("deploy", "e2e", "faults")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    return True if is_left_out(collection_path, config) else None  # None lets others say


@pytest.hookimpl(tryfirst=True)  # before tests are deselected by their marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if is_outside(item):
            item.add_marker(pytest.mark.outside)
        if is_long(item):
            item.add_marker(pytest.mark.long)
    ranks = _ranks(dict.fromkeys(item.path for item in items))
    items.sort(key=lambda item: ranks[item.path])


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect no garbage while all modules are imported: it takes a sixth of that time, in each worker."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_finish() -> None:
    """Keep the tests and their imports out of every later garbage collection: a quarter of the API tests' time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def _ranks(files: Iterable[Path]) -> dict[Path, tuple[int, float]]:
    """Return what to sort the files of tests by.

    Those that wait for other programs come among those that compute, so that no processor is idle; and none of them is
    among the last, for which one worker would keep the others waiting.
    """
    kinds: tuple[list[Path], list[Path], list[Path]] = ([], [], [])
    for path in files:
        folder = path.relative_to(Path(__file__).parent).parts[0]
        kinds[0 if folder in FIRST else 1 if folder in WAITING else 2].append(path)
    first, waiting, computing = kinds
    parts = ((first, 0, 1.0), (waiting, 1, 0.9), (computing, 1, 1.0))
    return {path: (turn, share * n / len(part)) for part, turn, share in parts for n, path in enumerate(part)}


@pytest.fixture
def router_endpoint() -> Iterator[str]:
    """Return the endpoint of a Zenoh router that runs during the test."""
    endpoint = free_endpoint()
    with running_router(endpoint):
        yield endpoint
