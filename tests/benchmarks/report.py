"""The measurements as tables, and their place in the documents."""

from pathlib import Path

from benchmarks.step import Figures
from dropanchor_evaluation.results import PAGES, ROOT, Measured, write

_PAGE = PAGES / "performance.md"
_PAGE_OF = {**dict.fromkeys(("cluster", "hosts", "shard"), PAGES / "cluster.md"), "walk": PAGES / "walk.md"}
"""Tables that have a page of their own."""
_WHOLE = ("estimation/fleet", "ingest", "zenoh_io")
_CLUSTER = ("cluster", "shards", "ownership")
SOURCES = {
    "blackbox": ("blackbox", "offline", *_WHOLE),
    "bursts": _WHOLE,
    "capacity": _WHOLE,
    "cluster": _CLUSTER,
    "delivery": ("delivery",),
    "engines": ("estimation",),
    "history": ("history",),
    "hosts": _CLUSTER,
    "idle": _WHOLE,
    "nodes": ("answers", "api", "node"),
    "overload": _WHOLE,
    "page": ("dashboard",),
    "pose-json": ("answers",),
    "rest": ("answers", "api"),
    "sessions": _WHOLE,
    "shard": (*_WHOLE, "cluster", "shards", "ownership", "checkpoints"),
    "small": (*_WHOLE, "runtime", "events", "delivery"),
    "sites": ("estimation/fleet", "ingest", "store"),
    "threads": ("estimation",),
    "walk": ("dashboard",),
    "zones": ("zones",),
}
"""What each table measures, below the package of the service."""
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


def page_of(name: str) -> Path:
    """Return the page of a table."""
    return _PAGE_OF.get(name, _PAGE)


def record(name: str, text: str) -> None:
    """Print the table, and write it between the markers of this name in the page of results."""
    print(f"\n== {name}\n{text}", flush=True)
    write(
        ROOT,
        page_of(name),
        name,
        text,
        Measured([f"service/dropanchor_service/{source}" for source in SOURCES[name]]),
    )
