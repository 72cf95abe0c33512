"""The example for microcontrollers against the real zenoh-pico, where there is one."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from support.listening import listening
from support.service import running_service
from support.zenoh_pico import zenoh_pico
from support.zenoh_router import wait_until

EXAMPLES = Path(__file__).parents[3] / "tag_client/c/examples"
SOURCES = ("zenoh_pico_tag.c", "posix_main.c")
MOTION_S = 180.0  # what the example needs to tell forwards from backwards, at its speed
WARNINGS = ("-std=gnu11", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-DZENOH_LINUX")


def prefix() -> Path:
    found = zenoh_pico()
    if found is None:
        pytest.skip("zenoh-pico is not installed: set ZENOH_PICO_PREFIX to where its include/zenoh-pico.h is")
    return found


def compiler() -> str:
    found = shutil.which("gcc") or shutil.which("clang")
    if found is None:
        pytest.skip("there is no C compiler: gcc or clang is needed to compile the example")
    return found


@pytest.mark.parametrize("source", SOURCES)
def test_the_example_compiles_without_a_warning(tmp_path: Path, source: str) -> None:
    include = f"-isystem{prefix() / 'include'}"
    command = [compiler(), *WARNINGS, include, "-c", str(EXAMPLES / source), "-o", str(tmp_path / "example.o")]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr


@contextmanager
def running_example(folder: Path, endpoint: str) -> Iterator[None]:
    """Compile the example with zenoh-pico, and run it as the tag cart-1."""
    library = prefix() / "lib/libzenohpico.a"
    if not library.is_file():
        pytest.skip(f"{library} is not there: the example can be compiled but not run")
    program = folder / "tag"
    sources = [str(EXAMPLES / source) for source in SOURCES]
    include = f"-isystem{prefix() / 'include'}"
    command = [compiler(), *WARNINGS, include, *sources, str(library), "-lm", "-lpthread", "-o", str(program)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    process = subprocess.Popen([program, endpoint, "cart-1"])
    try:
        yield
    finally:
        process.kill()
        process.wait()


def test_the_example_publishes_ranges_and_imu_samples(tmp_path: Path, router_endpoint: str) -> None:
    with listening(router_endpoint) as heard, running_example(tmp_path, router_endpoint):
        wait_until(lambda: len(heard.ranges()) >= 10)
    assert {key.split("/")[-2] for key in heard.keys} == {"cart-1"}
    numbers = [frame.sequence or 0 for frame in heard.frames]  # the first may be gone before anybody is known to listen
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert len({frame.boot_id for frame in heard.frames}) == 1
    assert all(frame.boot_clock for frame in heard.frames)
    assert heard.frames[-1].imu[0].acc == pytest.approx((0.0, 0.0, 9.81), abs=2.0)


def test_the_example_is_tracked_where_it_is(tmp_path: Path) -> None:
    with running_service() as service, running_example(tmp_path, service.zenoh):

        def pose() -> dict[str, Any]:
            return next(iter(service.get("/api/v1/poses")["poses"]), {})

        wait_until(lambda: pose().get("state") == "tracking", MOTION_S)
        found = pose()
    assert abs(found["x"]) < 8.0
    assert 5.0 < found["y"] < 15.0
