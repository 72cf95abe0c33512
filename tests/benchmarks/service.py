"""Read the counters of the measured service, and write its settings."""

from dataclasses import dataclass, field
from pathlib import Path

import httpx

from benchmarks import proc
from benchmarks.motion import ANCHOR, SAMPLES_PER_MESSAGE, tracks
from support.service import Running

MAX_TAGS = 200_000


@dataclass(frozen=True)
class Counters:
    """The counts of the service so far. delays: upper bound of a bucket in s → number of batches up to this delay."""

    fused: float  # samples
    shed: float  # messages
    shed_samples: float
    cpu_s: float
    resident_bytes: int
    delays: dict[float, float] = field(default_factory=dict)


def counters(service: Running) -> Counters:
    """Read the counters of the service."""
    values = _values(httpx.get(f"{service.url}/metrics", timeout=30.0).text)
    bucket = 'dropanchor_pose_delay_seconds_bucket{le="'
    delays = {float(name[len(bucket) : -2]): value for name, value in values.items() if name.startswith(bucket)}
    return Counters(
        sum(values[f'dropanchor_samples_total{{kind="{kind}"}}'] for kind in ("imu", "range")),
        values['dropanchor_rejected_total{reason="shed"}'],
        values["dropanchor_shed_samples_total"],
        proc.cpu_s(service.process.pid),
        proc.resident_bytes(service.process.pid),
        delays,
    )


def rejected(service: Running) -> dict[str, float]:
    """Return the rejections by metric, without zeros."""
    values = _values(httpx.get(f"{service.url}/metrics", timeout=30.0).text)
    return {name: value for name, value in values.items() if name.startswith("dropanchor_rejected_total") and value}


def _values(text: str) -> dict[str, float]:
    lines = (line.rpartition(" ") for line in text.splitlines() if line and not line.startswith("#"))
    return {name: float(value) for name, _, value in lines}


def lost(sent_messages: int, since: Counters, until: Counters) -> int:
    """Return how many samples were sent but did not reach the estimators."""
    return sent_messages * SAMPLES_PER_MESSAGE - int(until.fused - since.fused)


def settings_file(tags: int, folder: Path, threads: int | None = None) -> Path:
    """Write settings with an anchor at the origin and the start of every tag. threads: of the engine, None: its own."""
    starts = [track.start for track in tracks(1.0)]
    tables = [
        f"[tags.sim-{i}.start]\nx = {x!r}\ny = {y!r}\nheading_rad = {heading!r}"
        for i, (x, y, heading) in ((i, starts[i % len(starts)]) for i in range(tags))
    ]
    file = folder / f"fleet-{tags}.toml"
    engine = "" if threads is None else f"engine_threads = {threads}\n"
    file.write_text(f'{engine}max_tags = {MAX_TAGS}\n[[site.anchors]]\nid = "{ANCHOR}"\n' + "\n".join(tables))
    return file
