"""What an answer over HTTP costs the service."""

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


def test_one_pose_costs_little_more_than_a_bare_answer_and_all_of_them_a_few_ms(
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
        cost = {path: cost_ms(s, path, times) for path, times in ((BARE, 3000), (ONE, 3000), (ALL, 40))}
    report.record(
        "rest",
        f"CPU of the service per request, uvicorn on loopback: `{BARE}` {cost[BARE]:.2f} ms, `{ONE}` {cost[ONE]:.2f} "
        f"ms ({cost[ONE] / cost[BARE]:.2f} times), `{ALL}` of {found:,} tags {cost[ALL]:.0f} ms.",
    )


def cost_ms(service: Running, path: str, times: int) -> float:
    """Median of five rounds."""
    costs = []
    with httpx.Client(base_url=service.url, timeout=30.0) as client:
        client.get(path).raise_for_status()
        for _ in range(5):
            before_s = proc.cpu_s(service.process.pid)
            for _ in range(times // 5):
                client.get(path)
            costs.append((proc.cpu_s(service.process.pid) - before_s) / (times // 5) * 1e3)
            time.sleep(0.1)
    return median(costs)
