"""Measure one fleet size end to end, with a process each for router, generator and service."""

import json
import subprocess
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import proc
from benchmarks.motion import SAMPLES_PER_MESSAGE
from benchmarks.probe import latencies_ms
from benchmarks.programs import generator, router, running
from benchmarks.service import Counters, counters, lost, settings_file
from support.service import running_service
from support.zenoh_router import free_endpoint, wait_until

WARM_UP_S, MEASURE_S = 4.0, 6.0
QUIET_S = 0.5  # after so long without a new sample, all samples have arrived


@dataclass
class Figures:
    """The figures of one fleet size.

    cpu: CPU-seconds of the service per second. latency_ms: from the newest sample of a message to its pose in a reply.
    store_ms: from arrival to the store, upper bounds of p50 and p99. late_p99_ms: delay of the generator's bursts.
    """

    tags: int
    cpu: float
    router_cpu: float
    cpu_s_per_million: float
    latency_ms: list[float]
    store_ms: tuple[float, float]
    bytes_per_tag: float
    lost: int
    late_p99_ms: float
    load: float

    def percentile(self, q: float) -> float:
        return float(np.percentile(self.latency_ms, q)) if self.latency_ms else float("inf")


def run_step(
    tags: int,
    folder: Path,
    embedded: bool = False,
    share: float = 1.0,
    warm_up_s: float = WARM_UP_S,
    threads: int | None = None,
) -> Figures:
    """Measure a fleet of `tags` tags, which all start at once, from warm_up_s on.

    embedded: the service is the router. share: of the time that the service runs. threads: of the engine, None: as many
    as it takes by itself.
    """
    endpoint = free_endpoint()
    link = "--zenoh-listen" if embedded else "--zenoh-connect"
    with ExitStack() as stack:
        routing = None if embedded else stack.enter_context(router(endpoint))
        arguments = ("--config", str(settings_file(tags, folder, threads)), link, endpoint)
        service = stack.enter_context(running_service(*arguments))
        fleet = generator(endpoint, tags, warm_up_s + MEASURE_S + 1.0)
        stack.callback(fleet.end)
        stack.enter_context(proc.throttled(service.process.pid, share))
        start_ns = (time.time_ns() + 300_000_000) // 1000 * 1000
        at_first = counters(service)
        fleet.send_line(start_ns)
        time.sleep(warm_up_s + 0.3)
        before, router_before, began_s = counters(service), _cpu(routing), time.monotonic()
        latency_ms = latencies_ms(endpoint, tags, start_ns, MEASURE_S)
        after, router_after, spent_s = counters(service), _cpu(routing), time.monotonic() - began_s
        load = proc.load()
        report = json.loads(fleet.request("end"))
        at_last = when_quiet(lambda: counters(service))
        return Figures(
            tags,
            (after.cpu_s - before.cpu_s) / spent_s,
            (router_after - router_before) / spent_s,
            (after.cpu_s - before.cpu_s) / max((after.fused - before.fused) * 1e-6, 1e-9),
            latency_ms,
            _quantiles_ms(before.delays, after.delays),
            (after.resident_bytes - at_first.resident_bytes) / tags,
            lost(report["messages"], at_first, at_last),
            report["late_p99_ms"],
            load,
        )


def run_receiver(tags: int, duration_s: float = 6.0) -> float:
    """Return what Zenoh alone costs a Python process behind a router, in CPU-seconds per million samples."""
    endpoint = free_endpoint()
    with router(endpoint), running("receiver", endpoint) as receiver:
        fleet = generator(endpoint, tags, duration_s)
        try:
            before = proc.cpu_s(receiver.process.pid)
            fleet.send_line(time.time_ns() + 300_000_000)
            fleet.request("end")
            messages, _ = receiver.request("end").split()
        finally:
            fleet.end()
        return (proc.cpu_s(receiver.process.pid) - before) / (int(messages) * SAMPLES_PER_MESSAGE * 1e-6)


def when_quiet(read: Callable[[], Counters], timeout_s: float = 60.0, quiet_s: float = QUIET_S) -> Counters:
    """Return the counters once no sample has been fused for `quiet_s`."""
    last = read()

    def unchanged() -> bool:
        nonlocal last
        time.sleep(quiet_s)
        before, last = last, read()
        return before.fused == last.fused

    wait_until(unchanged, timeout_s)
    return last


def _cpu(process: subprocess.Popen[str] | None) -> float:
    return 0.0 if process is None else proc.cpu_s(process.pid)


def _quantiles_ms(before: dict[float, float], after: dict[float, float]) -> tuple[float, float]:
    """Return the upper bounds in ms of the buckets that contain p50 and p99 of the delays between two readings."""
    counts = {bound: after[bound] - before[bound] for bound in after}
    total = counts[float("inf")]
    bounds_s = [min((b for b, n in counts.items() if n >= q * total), default=float("inf")) for q in (0.5, 0.99)]
    return bounds_s[0] * 1e3, bounds_s[1] * 1e3
