"""Measure what an HTTP response costs the service."""

import time
from statistics import median

import httpx
import pytest

from benchmarks import proc, report
from benchmarks.programs import generator, router
from benchmarks.service import settings_file
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, wait_until

pytestmark = pytest.mark.benchmark

TAGS = 10_000
ONE, BARE, ALL = "/api/v1/tags/sim-5/pose", "/api/v1/health/live", "/api/v1/poses"


def test_the_cost_of_one_pose_and_of_all_poses_beside_an_empty_response(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    endpoint = free_endpoint()
    file = settings_file(TAGS, tmp_path_factory.mktemp("rest"))
    with (
        router(endpoint),
        running_service("--config", str(file), "--engine", "fleet", "--zenoh-connect", endpoint) as s,
    ):
        fleet = generator(endpoint, 10, 1.0, register=TAGS)
        try:
            wait_until(lambda: len(s.get(ALL)["poses"]) >= 0.99 * TAGS, 120.0)
        finally:
            fleet.end()
        found = len(s.get(ALL)["poses"])
        cost = costs_ms(s, {BARE: 500, ONE: 500, ALL: 8})
    report.record(
        "rest",
        f"CPU of the service per request, uvicorn on loopback: `{BARE}` {cost[BARE]:.2f} ms, `{ONE}` {cost[ONE]:.2f} "
        f"ms ({cost[ONE] / cost[BARE]:.2f} times), `{ALL}` of {found:,} tags {cost[ALL]:.0f} ms.",
    )


def costs_ms(service: Running, requests: dict[str, int]) -> dict[str, float]:
    """Return the median cost of a request to each path over ten rounds.

    Each round requests every path, so that other load on the machine affects all of them alike.
    """
    costs: dict[str, list[float]] = {path: [] for path in requests}
    with httpx.Client(base_url=service.url, timeout=30.0) as client:
        for _ in range(10):
            for path, times in requests.items():
                before_s = proc.cpu_s(service.process.pid)
                for _ in range(times):
                    client.get(path).raise_for_status()
                costs[path].append((proc.cpu_s(service.process.pid) - before_s) / times * 1e3)
                time.sleep(0.1)
    return {path: median(each) for path, each in costs.items()}
