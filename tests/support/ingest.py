"""The ingest without threads or network, around an engine whose poses are easy to predict."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from prometheus_client import Counter
from prometheus_client.samples import Sample

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, encode_packed
from dropanchor_service.checkpoints.snapshot import ServiceState
from dropanchor_service.engines.warm_up import warm_up_ingest
from dropanchor_service.estimation.columns import POSE, Array, PoseBatch, SampleBatch, State
from dropanchor_service.estimation.protocols import Engine
from dropanchor_service.ingest.admission import Admission
from dropanchor_service.ingest.buffer import MessageBuffer
from dropanchor_service.ingest.guarded_engine import GuardedEngine
from dropanchor_service.ingest.observers import NO_OBSERVERS, Observers
from dropanchor_service.ingest.publishers import Publishers
from dropanchor_service.ingest.turn import Ingest
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.settings.sources import load_settings
from dropanchor_service.store import LatestPoses, Sites, SiteStore


@dataclass
class TransparentEngine:
    """Return one pose per range, whose x is the range. Raise an error for the samples that `poisoned` selects."""

    name: str = "transparent"
    anchors: Array | None = None
    configured: dict[int, list[Array]] = field(default_factory=dict)
    batches: list[SampleBatch] = field(default_factory=list)
    poisoned: Callable[[SampleBatch], bool] = lambda _: False

    def set_anchors(self, anchors: Array) -> None:
        self.anchors = anchors

    def configure(self, row: int, settings: Array) -> None:
        self.configured.setdefault(row, []).append(settings)

    def process(self, samples: SampleBatch) -> PoseBatch:
        if self.poisoned(samples):
            raise FloatingPointError("injected by the test")
        assert {*samples.ranges["row"].tolist(), *samples.imu["row"].tolist()} <= set(self.configured)
        self.batches.append(samples)
        poses = np.zeros(len(samples.ranges), POSE)
        for name in ("row", "t_ns", "anchor", "range"):
            poses[name] = samples.ranges[name]
        poses["x"], poses["state"] = samples.ranges["range"], State.TRACKING
        return PoseBatch(poses=poses)


class IngestBench:
    """The part of a service between Zenoh and the store.

    engine: used in place of the `TransparentEngine` in `self.engine`. sites: in place of the one of the settings;
    `site` and `tags` are of the first one. options: settings by key.
    """

    def __init__(
        self,
        folder: Path | None = None,
        capacity: int = 10**8,
        engine: Engine | None = None,
        clock: UtcClock | None = None,
        sites: Sites | None = None,
        observers: Observers = NO_OBSERVERS,
        **options: Any,
    ) -> None:
        warm_up_ingest()
        settings = load_settings(options=options, environment={})
        self.engine = TransparentEngine()
        self.clock = clock or UtcClock()
        self.metrics = Metrics()
        self.latest = LatestPoses()
        self.sites = sites or Sites([(SiteStore(settings.site, dict(settings.tags), folder), settings.quota)])
        first = self.sites[0]
        self.site, self.tags, self.health, self.pending_tags = first.store, first.tags, first.health, first.pending_tags
        self.buffer = MessageBuffer(capacity)
        self.guarded_engine = GuardedEngine(engine or self.engine, self.sites, self.metrics)
        self.publishers = Publishers()
        self.ingest = Ingest(
            self.buffer,
            Admission(self.sites),
            self.guarded_engine,
            self.publishers,
            self.sites,
            self.latest,
            self.metrics,
            self.clock,
            observers,
        )

    def service_state(self) -> ServiceState:
        """Return what a checkpoint of this service holds."""
        return ServiceState(self.sites, self.latest, self.guarded_engine, self.publishers)

    def put(
        self, tag: str, payload: bytes | Frame, encoding: str = ENCODING_PACKED, at_ns: int = 0, site: str = "default"
    ) -> None:
        """Append a message to the buffer. at_ns: when it arrived, UTC; 0: now."""
        data = encode_packed(payload) if isinstance(payload, Frame) else payload
        self.buffer.append(samples_key(site, tag), data, encoding, at_ns or self.clock.now_ns())

    def send(self, tag: str, *payloads: bytes | Frame) -> None:
        """Append messages of a tag and run one turn."""
        for payload in payloads:
            self.put(tag, payload)
        self.ingest.turn()

    def rejected(self) -> dict[str, float]:
        """Return the rejections by reason, without zeros."""
        return {s.labels["reason"]: s.value for s in _totals(self.metrics.rejected) if s.value}

    def faults(self) -> dict[str, float]:
        """Return the internal errors by place, without zeros."""
        return {where: value for where, fault in self.metrics.faults.items() if (value := self.total(fault))}

    def total(self, counter: Counter, **labels: str) -> float:
        """Return the sum of a counter over all of its labels, or over these."""
        return sum(s.value for s in _totals(counter) if labels.items() <= s.labels.items())

    def x_of(self, tags: Sequence[str]) -> list[float | None]:
        """Return x of the latest pose of each tag; None for a tag without a pose."""
        rows = [self.tags.find(tag) for tag in tags]
        poses = [None if tag is None else self.latest.row(tag.row) for tag in rows]
        return [None if pose is None else float(pose["x"]) for pose in poses]


def _totals(counter: Counter) -> list[Sample]:
    return [sample for metric in counter.collect() for sample in metric.samples if sample.name.endswith("_total")]
