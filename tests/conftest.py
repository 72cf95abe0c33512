"""Set-up and fixtures for the whole suite."""

import gc
import logging
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from dropanchor_service.runtime.repeats import CountingHandler
from support.kernel_cache import use_cache_of_these_sources
from support.outside import is_left_out, is_long, is_outside
from support.patience import be_patient_with_http
from support.zenoh_router import free_endpoint, running_router

if TYPE_CHECKING:  # tests without a page need no Playwright
    from playwright.sync_api import Browser

    from support.browser import PausedBrowser

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


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    return True if is_left_out(collection_path, config) else None  # None lets others say


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Name bytes after their argument: packed ones may hold the time, and all workers must name alike."""
    return argname if isinstance(val, bytes) else None


@pytest.hookimpl(tryfirst=True)  # before tests are deselected by their marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if is_outside(item):
            item.add_marker(pytest.mark.outside)
        if is_long(item):
            item.add_marker(pytest.mark.long)
    items.sort(key=_rank)


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


def _rank(item: pytest.Item) -> int:
    folder = item.path.relative_to(item.config.rootpath / "tests").parts[0]
    return FIRST.index(folder) if folder in FIRST else len(FIRST)


@pytest.fixture(autouse=True)
def _own_log() -> Iterator[None]:
    """Take back what a command of the test did to the log: its later lines would fall into another test's output."""
    level = logging.root.level
    yield
    logging.root.setLevel(level)
    for handler in [one for one in logging.root.handlers if isinstance(one, CountingHandler)]:
        logging.root.removeHandler(handler)
        handler.stream = sys.stderr  # that of the test is closed
        handler.close()


@pytest.fixture(scope="session")
def shared_chromium() -> Iterator["PausedBrowser"]:
    """Return the browser of this worker, which a test drives in a block."""
    from support.browser import PausedBrowser, running_chromium

    with running_chromium() as browser:
        paused = PausedBrowser(browser)
        with paused.paused():
            yield paused


@pytest.fixture(scope="module")
def chromium(shared_chromium: "PausedBrowser") -> Iterator["Browser"]:
    """Return the browser of this worker, for a file whose tests run no event loop."""
    with shared_chromium.driven() as browser:
        yield browser


@pytest.fixture
def router_endpoint() -> Iterator[str]:
    """Return the endpoint of a Zenoh router that runs during the test."""
    endpoint = free_endpoint()
    with running_router(endpoint):
        yield endpoint
