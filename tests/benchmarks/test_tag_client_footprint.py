"""Measure what a tag client costs: import time, memory, bytes on the wire, and publishing rate."""

import json
import statistics
from collections.abc import Callable

import pytest

from support.commands import python
from support.zenoh_router import free_endpoint, running_router

pytestmark = pytest.mark.benchmark

IMPORT = """
import time
began = time.perf_counter()
from dropanchor_tag_client import TagClient
print(time.perf_counter() - began)
"""

RUN = """
import json, resource, sys, time
from dropanchor_tag_client import TagClient

def resident_mb():
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * resource.getpagesize() / 1e6

def publish(tag, samples):
    for i in range(samples // 2):
        tag.publish_range(7, 12.25)
        tag.publish_imu((0.0, 0.0, 9.8), (0.0, 0.0, 0.1), (0.0, 20.0, -44.0))

with TagClient("a", connect=sys.argv[1], encoding=sys.argv[2], batch_samples=20) as tag:
    open_mb = resident_mb()
    for message in range(700):  # fills the cache of 600 messages
        publish(tag, 20)
        time.sleep(0.003)
    publishing_mb = resident_mb()
    sent = tag.sent
    began = time.perf_counter()
    publish(tag, 40_000)
    rate = 40_000 / (time.perf_counter() - began)
print(json.dumps({
    "resident_mb_open": open_mb,
    "resident_mb_publishing": publishing_mb,
    "resident_mb_peak_of_burst": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000,
    "burst_samples_per_s": rate,
    "bytes_per_sample": sent.payload_bytes / sent.samples,
}))
"""


def measured(encoding: str) -> dict[str, float]:
    endpoint = free_endpoint()
    with running_router(endpoint):
        done = python("-c", RUN, endpoint, encoding)
    assert done.returncode == 0, done.stderr
    result: dict[str, float] = json.loads(done.stdout)
    return result


def test_the_footprint_of_a_tag_client_is_measured(record_property: Callable[[str, object], None]) -> None:
    imports = [float(python("-c", IMPORT).stdout) for _ in range(5)]
    figures: dict[str, float] = {"import_s_median": round(statistics.median(imports), 4)}
    for encoding in ("packed", "json"):
        for name, value in measured(encoding).items():
            figures[f"{encoding}_{name}"] = round(value, 1)
    for name, value in figures.items():
        record_property(name, value)
        print(f"{name:28} {value}")
