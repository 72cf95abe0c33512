"""The measurements as tables, and their place in the README beside this."""

import os
import platform
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.step import Figures

README = Path(__file__).with_name("README.md")
HEAD = (
    "| tags | samples/s | service CPU | CPU-s per 10⁶ samples | query p50 / p99 ms | store p50 / p99 ms ≤ "
    "| kB per tag | lost | router CPU | generator late p99 ms | load |\n" + "|---" * 11 + "|"
)


def row(figures: Figures, name: str = "") -> str:
    cells = (
        f"{figures.tags}{name}",
        f"{figures.tags * 110:,}",
        f"{figures.cpu:.2f}",
        f"{figures.cpu_s_per_million:.2f}",
        f"{figures.percentile(50):.0f} / {figures.percentile(99):.0f}",
        f"{figures.store_ms[0]:.1f} / {figures.store_ms[1]:.1f}",
        f"{figures.bytes_per_tag / 1e3:.1f}",
        f"{figures.lost}",
        f"{figures.router_cpu:.2f}",
        f"{figures.late_p99_ms:.1f}",
        f"{figures.load:.1f}",
    )
    return "| " + " | ".join(cells) + " |"


def ratios(end_to_end: float, costs: dict[str, float]) -> str:
    """Each cost in CPU-seconds per million samples, and as a multiple of the service end to end."""
    lines = [f"| {name} | {cost:.2f} | {cost / end_to_end:.2f} |" for name, cost in costs.items()]
    head = ["| in the same run | CPU-s per 10⁶ samples | ÷ the service end to end |", "|---|---|---|"]
    return "\n".join([*head, f"| the service, end to end | {end_to_end:.2f} | 1.00 |", *lines])


def record(name: str, text: str) -> None:
    """Print it, and put it between the marks of this name in the README."""
    when = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    cores = f"{os.cpu_count()} cores of {_processor()}"
    block = f"{text}\n\nMeasured {when}, Python {platform.python_version()}, {cores}.\n"
    print(f"\n== {name}\n{block}", flush=True)
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
    before, _, rest = README.read_text(encoding="utf-8").partition(begin)
    _, found, after = rest.partition(end)
    assert found, f"{README.name} has no place for {name}"
    README.write_text(f"{before}{begin}\n{block}\n{end}{after}", encoding="utf-8")


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
