"""Which tests need more than this process, or take long: `make test FAST=1` leaves them out."""

import functools
from pathlib import Path

import pytest

FOLDERS = {"benchmarks", "deploy", "e2e", "faults"}
FIXTURES = {"chromium", "database", "postgresql", "router_endpoint", "server"}
STARTERS = {
    "Browser",
    "compile_once",
    "connected_session",
    "dropping_router",
    "ended",
    "in_words",
    "listening",
    "mosquitto",
    "page_types",
    "python",
    "router_process",
    "running_chromium",
    "running_postgresql",
    "running_router",
    "running_service",
    "start_router_process",
    "subprocess",
    "zenoh",
}
"""What a module imports that starts a browser, a program, a router or a database."""
LONG = (
    "authorities",
    "evaluation",
    "replay",
    "service/api/omlox/test_contract.py",
    "service/api/test_contract.py",
    "service/delivery/test_storm.py",
    "service/estimation/fleet/belief",
    "service/estimation/fleet/smoother",
    "service/estimation/fleet/test_honest_vehicles.py",
    "service/estimation/fleet/test_recorded_honesty.py",
    "service/estimation/fleet/test_recordings.py",
    "service/estimation/paper/test_engine.py",
    "service/estimation/paper/test_simulation.py",
    "service/history/test_heat_map.py",
    "service/history/test_overview.py",
    "service/node/test_contract.py",
    "service/zones/test_false_events.py",
    "service/zones/test_probability.py",
    "tag_client/simulator/test_live.py",
    "tag_client/simulator/test_raw_imu.py",
    "tag_client/sources/modules/test_fuzz.py",
)
"""Files and folders whose tests simulate minutes of data or make hundreds of requests at random."""


def is_left_out(path: Path, config: pytest.Config) -> bool:
    """Return whether the marks that are asked for leave out all tests of a file or folder, so that none is imported."""
    tests, wanted = config.rootpath / "tests", str(config.option.markexpr)
    conditions = [] if " or " in wanted else wanted.split(" and ")
    return path.is_relative_to(tests) and (
        ("not outside" in conditions and _is_in(_below(path, tests), tuple(FOLDERS)))
        or ("not long" in conditions and _is_in(_below(path, tests), LONG))
    )


def is_long(item: pytest.Item) -> bool:
    """Return whether a test is one of LONG."""
    return _is_in(_path(item), LONG)


def is_outside(item: pytest.Item) -> bool:
    """Return whether a test needs a browser, another process, a router or a database."""
    assert isinstance(item, pytest.Function)
    return (
        _path(item).parts[0] in FOLDERS
        or not FIXTURES.isdisjoint(item.fixturenames)
        or not STARTERS.isdisjoint(vars(item.module))
    )


@functools.cache  # thousands of tests are in hundreds of files
def _is_in(path: Path, several: tuple[str, ...]) -> bool:
    return any(path.is_relative_to(one) for one in several)


def _path(item: pytest.Item) -> Path:
    return _below(item.path, item.config.rootpath / "tests")


@functools.cache
def _below(path: Path, folder: Path) -> Path:
    return path.relative_to(folder)
