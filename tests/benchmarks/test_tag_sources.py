"""Measure what each source of `dropanchor-tag` costs at its full rate."""

import statistics
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks import proc
from benchmarks.tag_sources import Process, imu, mqtt, publish, serial
from dropanchor_evaluation.results import PAGES, ROOT, Measured, write
from support.commands import python
from support.listening import ReceivedFrames, listening
from support.mosquitto import needs_mosquitto
from support.relay import running_relay
from support.zenoh_router import free_port, running_router, wait_until

PAGE = PAGES / "tags.md"
CLIENT = "tag_client/dropanchor_tag_client"
MEASURED_S = 20.0
MAX_IMPORT_S, MAX_CPU = 0.2, 0.05

_IMPORT = """
import sys, time
from importlib import import_module
began = time.process_time()
import dropanchor_tag_client.cli
import_module(f"dropanchor_tag_client.sources.{sys.argv[1]}")
print(time.process_time() - began)
"""
Run = Callable[[Path, str], AbstractContextManager[Process]]


class Cost(NamedTuple):
    """wire_bytes_per_s: on TCP, from the program to the router."""

    import_s: float
    resident_mb: float
    cpu: float
    samples_per_s: float
    wire_bytes_per_s: float


SOURCES: dict[str, tuple[str, str, Run]] = {
    "serial, DWM1001": ("serial", "10 ranges/s, pseudo-terminal", partial(serial, "dwm1001", 10)),
    "serial, LinkTrack": ("serial", "100 frames/s with IMU, pseudo-terminal", partial(serial, "linktrack", 100)),
    "imu": ("imu", "100 readings/s, fake chip without a bus", imu),
    "mqtt": ("mqtt", "110 messages/s, mosquitto", mqtt),
    "publish": ("publish", "110 lines/s", publish),
}


def samples(heard: ReceivedFrames) -> int:
    return sum(len(frame) for frame in heard.frames)


def cost(source: str, run: Run, folder: Path) -> Cost:
    imports = [float(python("-c", _IMPORT, source).stdout) for _ in range(5)]
    port = free_port()
    with (
        running_router(f"tcp/127.0.0.1:{port}"),
        running_relay(port) as relay,
        listening(f"tcp/127.0.0.1:{port}") as heard,
        run(folder, f"tcp/127.0.0.1:{relay.port}") as process,
    ):
        wait_until(lambda: samples(heard) > 20)
        time.sleep(2.0)  # the start is over
        began = (time.monotonic(), proc.cpu_s(process.pid), samples(heard), relay.from_clients)
        time.sleep(MEASURED_S)
        ended = (time.monotonic(), proc.cpu_s(process.pid), samples(heard), relay.from_clients)
        resident_mb = proc.resident_bytes(process.pid) / 1e6
    seconds, *differences = (after - before for before, after in zip(began, ended, strict=True))
    cpu, arrived, sent = (value / seconds for value in differences)
    return Cost(statistics.median(imports), resident_mb, cpu, arrived, sent)


@pytest.mark.benchmark
@needs_mosquitto
def test_the_cost_of_each_source_is_measured_and_within_its_limits(tmp_path: Path) -> None:
    costs = {name: cost(source, run, tmp_path) for name, (source, _, run) in SOURCES.items()}
    lines = [
        f"| `{name}` | {SOURCES[name][1]} | {one.import_s * 1000:.0f} | {one.resident_mb:.1f} | {one.cpu:.1%} "
        f"| {one.samples_per_s:.0f} | {one.wire_bytes_per_s:.0f} |"
        for name, one in costs.items()
    ]
    head = (
        "| source | fed with | import, ms | resident, MB | of a core | samples/s that arrived | bytes/s to the router |"
    )
    table = "\n".join([head, "|---" * 7 + "|", *lines])
    print(f"\n{table}", flush=True)
    write(ROOT, PAGE, "sources", table, Measured([f"{CLIENT}/sources", f"{CLIENT}/client.py", f"{CLIENT}/options.py"]))
    for name, one in costs.items():
        assert one.resident_mb < (42.0 if name == "mqtt" else 30.0), name
        assert one.import_s < MAX_IMPORT_S, name
        assert one.cpu < MAX_CPU, name
