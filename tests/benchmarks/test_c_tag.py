"""Measure what a tag in C costs at 100 Hz of IMU and 10 Hz of ranges: code, stack, memory, bytes on the wire."""

import shutil
import subprocess
import time
from pathlib import Path

import pytest

from benchmarks import proc
from dropanchor_evaluation.results import PAGES, ROOT, Measured, write
from support.listening import listening
from support.relay import running_relay
from support.zenoh_pico import zenoh_pico
from support.zenoh_router import free_port, running_router, wait_until

pytestmark = pytest.mark.benchmark

PAGE = PAGES / "tags.md"
EXAMPLES = ROOT / "tag_client/c/examples"
MEASURED_S = 20.0
_WRITE = """
#include "dropanchor.h"
size_t write_samples(const dropanchor_frame *frame, uint8_t *out, size_t room) {
    return dropanchor_write(frame, out, room);
}
"""
_SIZES = """
#include <stdio.h>
#include "dropanchor.h"
int main(void) {
    printf("%zu %zu", 10 * sizeof(dropanchor_imu) + sizeof(dropanchor_range), DROPANCHOR_SIZE(10, 1, 0, 0));
}
"""


def compiled(folder: Path, code: str, *options: str) -> None:
    (folder / "code.c").write_text(code)
    include = f"-I{ROOT / 'tag_client/c'}"
    subprocess.run(["gcc", "-std=c99", "-Os", include, *options, "code.c"], cwd=folder, check=True)


def section_bytes(file: Path) -> tuple[int, int]:
    """Return the bytes of code and constants, and of variables, in an object file."""
    text, data, bss = subprocess.check_output(["size", str(file)], text=True).splitlines()[1].split()[:3]
    return int(text), int(data) + int(bss)


def header_lines(folder: Path) -> list[str]:
    compiled(folder, _WRITE, "-fstack-usage", "-c", "-o", "write.o")
    code, variables = section_bytes(folder / "write.o")
    stack = sum(int(line.split("\t")[1]) for line in (folder / "write.su").read_text().splitlines())
    compiled(folder, _SIZES, "-o", "sizes")
    batch, payload = map(int, subprocess.check_output([folder / "sizes"], text=True).split())
    return [
        f"| `dropanchor_write`: code | {code} B |",
        f"| its stack, at most | {stack} B |",
        f"| its variables | {variables} B |",
        f"| samples of 100 ms (10 IMU, 1 range), before they are written | {batch} B |",
        f"| the payload of these | {payload} B |",
        f"| payloads per second | {10 * payload} B/s |",
    ]


def example_lines(folder: Path, prefix: Path) -> list[str]:
    """Return what the example costs with zenoh-pico, on this machine."""
    options = ("-std=gnu11", "-Os", "-DZENOH_LINUX", f"-isystem{prefix / 'include'}")
    for name in ("zenoh_pico_tag", "posix_main"):
        subprocess.run(["gcc", *options, "-c", EXAMPLES / f"{name}.c", "-o", folder / f"{name}.o"], check=True)
    objects = [folder / "zenoh_pico_tag.o", folder / "posix_main.o"]
    libraries: tuple[Path | str, ...] = (prefix / "lib/libzenohpico.a", "-lm", "-lpthread")
    subprocess.run(["gcc", *objects, *libraries, "-o", folder / "tag"], check=True)
    sent, resident = running_example(folder / "tag")
    return [
        f"| variables of `zenoh_pico_tag.c`, room for 64 samples of a kind | {section_bytes(objects[0])[1]} B |",
        f"| bytes that the example sends to the router, with Zenoh's framing | {sent:.0f} B/s |",
        f"| resident memory of the example with zenoh-pico on Linux | {resident / 1e6:.1f} MB |",
    ]


def running_example(program: Path) -> tuple[float, int]:
    """Return bytes per second on TCP, and resident bytes."""
    port = free_port()
    with (
        running_router(f"tcp/127.0.0.1:{port}"),
        running_relay(port) as relay,
        listening(f"tcp/127.0.0.1:{port}") as heard,
        subprocess.Popen([program, f"tcp/127.0.0.1:{relay.port}", "cart"]) as process,
    ):
        try:
            wait_until(lambda: len(heard.frames) > 20)
            began_s, before = time.monotonic(), relay.from_clients
            time.sleep(MEASURED_S)
            return (relay.from_clients - before) / (time.monotonic() - began_s), proc.resident_bytes(process.pid)
        finally:
            process.kill()


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_the_cost_of_a_tag_in_c_is_measured(tmp_path: Path) -> None:
    prefix = zenoh_pico()
    lines = header_lines(tmp_path) + ([] if prefix is None else example_lines(tmp_path, prefix))
    table = "\n".join(["| gcc -Os, x86-64 | |", "|---|---|", *lines])
    print(f"\n{table}", flush=True)
    write(ROOT, PAGE, "c", table, Measured(["tag_client/c"]))
