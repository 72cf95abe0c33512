"""Measure how many live tags one process carries, and compare the cost with the unavoidable part and a simple loop."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from benchmarks import report
from benchmarks.baselines import engine_cost, filterpy_cost
from benchmarks.step import Figures, run_receiver, run_step

STEPS = (500, 1000, 2000, 3000, 4000, 6000, 8000, 10_000, 12_000, 16_000)
BROKEN_MS = 250.0
SETTLED_S = 20.0  # after the start of all tags: by then most mounting angles are known

pytestmark = pytest.mark.benchmark


def breaks(figures: Figures) -> bool:
    return figures.lost > 0 or not figures.percentile(99) < BROKEN_MS


def test_the_fleet_grows_until_the_latency_is_too_long_or_samples_are_lost(tmp_path: Path) -> None:
    lines, carried = [report.HEAD], list[Figures]()

    def is_carried(tags: int) -> bool:
        figures = run_step(tags, tmp_path, warm_up_s=SETTLED_S)
        broken = breaks(figures)
        lines.append(report.row(figures, " (broken)" if broken else ""))
        print(lines[-1], flush=True)
        carried.extend([] if broken else [figures])
        return not broken

    broken = next((tags for tags in STEPS if not is_carried(tags)), None)
    assert carried, f"not even {STEPS[0]} tags are carried\n" + "\n".join(lines)
    if broken is not None:
        is_carried((carried[-1].tags + broken) // 2)
    best = carried[-1]
    half = run_step(best.tags // 2, tmp_path, warm_up_s=SETTLED_S)
    lines += [report.row(half, " (half)")]
    others: dict[str, Callable[[int, Path], Figures]] = {
        "half, the service is the router": partial(run_step, warm_up_s=SETTLED_S, embedded=True),
        "half, one engine thread": partial(run_step, warm_up_s=SETTLED_S, threads=1),
        "half, 4 s after the start": run_step,
    }
    lines += [report.row(run(best.tags // 2, tmp_path), f" ({name})") for name, run in others.items()]
    costs = {
        "Zenoh alone: receive, copy, drop": run_receiver(best.tags),
        "the engine `fleet` alone, no I/O": engine_cost("fleet", min(best.tags, 1000), 10),
        "the engine `paper` alone, no I/O": engine_cost("paper", 5, 5),
        "one filterpy EKF per tag, no I/O": filterpy_cost(50, 40),
    }
    loop = costs["one filterpy EKF per tag, no I/O"] / best.cpu_s_per_million
    unavoidable = sum(list(costs.values())[:2]) / best.cpu_s_per_million
    summary = [
        f"**{best.tags} tags are carried** with nothing lost, {best.tags / best.cpu:.0f} per core in use.",
        f"One filterpy EKF per tag, without any I/O, costs {loop:.0f} times as much as the service end to end.",
        f"{unavoidable:.0%} of the service's time is what cannot be avoided: receiving, and the bare engine.",
        f"p99 of the latency at half of the tags: {half.percentile(99):.0f} ms.",
    ]
    report.record("capacity", "\n".join([*summary, "", *lines, "", report.ratios(best.cpu_s_per_million, costs)]))
