"""One size of the fleet, end to end: router, generator and service, each a process of its own."""

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
QUIET_S = 0.5  # without a new sample everything has arrived


@dataclass
class Figures:
    """cpu: of the service, seconds per second. latency_ms: newest sample of a message → its pose in a query's reply.
    store_ms: arrival → store, the bounds that hold p50 and p99. late_p99_ms: of the generator's bursts."""

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


def run_step(tags: int, folder: Path, engine: str = "fleet", embedded: bool = False, share: float = 1.0) -> Figures:
    """embedded: the service is the router. share: of the time, in which the service runs."""
    endpoint = free_endpoint()
    link = "--zenoh-listen" if embedded else "--zenoh-connect"
    with ExitStack() as stack:
        routing = None if embedded else stack.enter_context(router(endpoint))
        arguments = ("--config", str(settings_file(tags, folder)), "--engine", engine, link, endpoint)
        service = stack.enter_context(running_service(*arguments))
        fleet = generator(endpoint, tags, WARM_UP_S + MEASURE_S + 1.0)
        stack.callback(fleet.end)
        stack.enter_context(proc.throttled(service.process.pid, share))
        start_ns = (time.time_ns() + 300_000_000) // 1000 * 1000
        at_first = counters(service)
        fleet.tell(start_ns)
        time.sleep(WARM_UP_S + 0.3)
        before, router_before, began_s = counters(service), _cpu(routing), time.monotonic()
        latency_ms = latencies_ms(endpoint, tags, start_ns, MEASURE_S)
        after, router_after, spent_s = counters(service), _cpu(routing), time.monotonic() - began_s
        load = proc.load()
        report = json.loads(fleet.ask("end"))
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
    """CPU-seconds per million samples that Zenoh alone costs a Python process behind a router."""
    endpoint = free_endpoint()
    with router(endpoint), running("receiver", endpoint) as receiver:
        fleet = generator(endpoint, tags, duration_s)
        try:
            before = proc.cpu_s(receiver.process.pid)
            fleet.tell(time.time_ns() + 300_000_000)
            fleet.ask("end")
            messages, _ = receiver.ask("end").split()
        finally:
            fleet.end()
        return (proc.cpu_s(receiver.process.pid) - before) / (int(messages) * SAMPLES_PER_MESSAGE * 1e-6)


def when_quiet(read: Callable[[], Counters], timeout_s: float = 60.0, quiet_s: float = QUIET_S) -> Counters:
    """The counters once no sample has been fused for a while."""
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
    """The bucket bounds that hold p50 and p99 of what came between: from arrival to the store."""
    counts = {bound: after[bound] - before[bound] for bound in after}
    total = counts[float("inf")]
    at_most = [min((b for b, n in counts.items() if n >= q * total), default=float("inf")) for q in (0.5, 0.99)]
    return at_most[0] * 1e3, at_most[1] * 1e3
