"""Measure the service under three times the load that it can carry, and its recovery afterwards.

The service runs for a share of the time only, as on a slower machine. Otherwise the generator and the router of three
times the load would need more processors than a small machine has, and would take them from the service.
"""

import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import zenoh

from benchmarks import proc, report
from benchmarks.motion import SAMPLES_PER_MESSAGE
from benchmarks.probe import age_ms
from benchmarks.programs import generator, router
from benchmarks.service import counters, settings_file
from benchmarks.step import run_step
from benchmarks.test_capacity import breaks
from support.service import running_service
from support.zenoh_router import connected_session, free_endpoint

SHARE = 0.25  # of the time
SIZES = (250, 500, 750, 1000, 1500, 2000, 3000)
OVERLOAD_S, BEFORE_S, AFTER_S = 8.0, 4.0, 20.0
GIVE_UP_S = 15.0  # recorded as the recovery time if it takes longer; the steady fleet still sends then
CURRENT_MS = 350.0  # maximum age of a current pose; a tag sends a message every 200 ms
HEAD = (
    "| tags carried | tags offered | pose age p50 / p99 / worst ms | shed messages | of all | shed samples "
    "| resident MB before / peak | current again after s |\n" + "|---" * 8 + "|"
)

pytestmark = pytest.mark.benchmark


def carried(folder: Path) -> int:
    """Return the largest of SIZES that the service carries."""
    best = SIZES[0] // 2
    for tags in SIZES:
        if breaks(run_step(tags, folder, share=SHARE)):
            break
        best = tags
    return best


def test_at_three_times_the_capacity_the_newest_messages_are_used_and_the_rest_is_counted(tmp_path: Path) -> None:
    capacity = carried(tmp_path)
    base, more = capacity // 2, 3 * capacity - capacity // 2
    endpoint = free_endpoint()
    arguments = (
        "--config",
        str(settings_file(base + more, tmp_path)),
        "--engine",
        "fleet",
        "--zenoh-connect",
        endpoint,
    )
    with ExitStack() as stack:
        stack.enter_context(router(endpoint))
        service = stack.enter_context(running_service(*arguments))
        session = stack.enter_context(connected_session(endpoint))
        stack.enter_context(proc.throttled(service.process.pid, SHARE))
        steady = generator(endpoint, base, BEFORE_S + OVERLOAD_S + AFTER_S, control="drop")
        flood = generator(endpoint, more, OVERLOAD_S, first=base, control="drop", register=more)
        try:
            start_ns = time.time_ns() + 300_000_000
            steady.send_line(start_ns)
            time.sleep(BEFORE_S + 0.3)
            before = counters(service)
            flood.send_line(time.time_ns() + 10_000_000)
            during = _watch(session, service.process.pid, base, OVERLOAD_S)
            ended_s = time.monotonic()
            flood.request("end")
            ended_s = max(ended_s, time.monotonic())
            recovered_s = _recovery_time(session, base, ended_s)
            after = counters(service)
        finally:
            steady.end()
            flood.end()
    ages, sizes = np.array(during).T
    shed = after.shed - before.shed
    cells = (
        f"{capacity}",
        f"{base + more}",
        " / ".join(f"{age:.0f}" for age in (*np.percentile(ages, (50, 99)), ages.max())),
        f"{shed:,.0f}",
        f"{shed / (shed + (after.fused - before.fused) / SAMPLES_PER_MESSAGE):.0%}",
        f"{after.shed_samples - before.shed_samples:,.0f}",
        f"{before.resident_bytes / 1e6:.0f} / {sizes.max() / 1e6:.0f}",
        f"{recovered_s:.1f}",
    )
    rows = [HEAD, "| " + " | ".join(cells) + " |"]
    report.record("overload", "\n".join(rows))
    assert after.fused > before.fused, "nothing is fused any more"


def _watch(session: zenoh.Session, pid: int, tags: int, duration_s: float) -> list[tuple[float, int]]:
    """Return the age of the pose of random tags in ms, each with the resident bytes of the service."""
    seen = []
    rng = np.random.default_rng(0)
    end_s = time.monotonic() + duration_s
    while time.monotonic() < end_s:
        seen.append((age_ms(session, int(rng.integers(tags))), proc.resident_bytes(pid)))
        time.sleep(0.02)
    return seen


def _recovery_time(session: zenoh.Session, tags: int, ended_s: float) -> float:
    """Wait until twenty tags in a row are current. Return the time since the end of the overload in s."""
    rng = np.random.default_rng(1)
    current = 0
    while current < 20 and time.monotonic() - ended_s < GIVE_UP_S:
        current = current + 1 if age_ms(session, int(rng.integers(tags))) < CURRENT_MS else 0
        time.sleep(0.01)
    return time.monotonic() - ended_s
