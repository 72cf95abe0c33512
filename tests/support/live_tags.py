"""Simulated tags that publish in real time while their router or service fails, and the poses to expect of them."""

import json
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from threading import Event, Thread
from typing import Any, Self

import numpy as np

from dropanchor_schemas.wire import Frame
from dropanchor_service.engines.choose import create_engine
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client import TagClient
from dropanchor_tag_client.simulator.live import Delivery, deliveries, start_poses, tag_name
from dropanchor_tag_client.simulator.sensors import preset
from support.ingest import IngestBench
from support.patience import PATIENCE_S
from support.service import Running
from support.zenoh_router import wait_until


class LiveTags:
    """Tags of the scenario "yard" with known starts that publish from `start` until `finish`.

    boot_clock: their clocks count from half an hour before the start.
    samples: number of samples published so far, by tag and kind. clock_ns: how far the clock of a tag is ahead.
    """

    def __init__(
        self,
        endpoint: str,
        tags: int,
        seed: int,
        cache_messages: int = 600,
        step_s: float = 0.1,
        boot_clock: bool = False,
        site: str = "default",
    ) -> None:
        self._endpoint = endpoint
        self._site = site
        self._step_s = step_s
        self._boot_clock = boot_clock
        self._stop = Event()
        self._cache_messages = cache_messages
        self._seed = seed
        self._tags = tags
        self._sent = 0  # deliveries
        self._clients = ExitStack()
        self._thread = Thread(target=self._run, daemon=True)
        self.samples: dict[str, Counter[str]] = defaultdict(Counter)
        self.clock_ns: dict[str, int] = defaultdict(int)

    def write_settings(self, folder: Path, *more: str) -> Path:
        """Write a settings file with the anchor and the start of each tag. more: further lines at its top."""
        lines = ['engine = "fleet"', *more, "[[site.anchors]]", 'id = "1"']
        for index, pose in enumerate(start_poses(self._tags, self._seed)):
            start = f"{{ x = {pose.x}, y = {pose.y}, heading_rad = {pose.heading_rad} }}"
            lines += [f"[tags.{json.dumps(tag_name(index))}]", f"start = {start}"]
        file = folder / "live.toml"
        file.write_text("\n".join(lines) + "\n")
        return file

    def __enter__(self) -> Self:
        self.start()
        return self

    def start(self) -> None:
        """Open a client per tag, and begin to publish 0.2 s from now."""
        self._opened = [
            self._clients.enter_context(
                TagClient(
                    tag_name(index),
                    site=self._site,
                    connect=self._endpoint,
                    cache_messages=self._cache_messages,
                    clock="boot" if self._boot_clock else "utc",
                    batch_s=None,
                    connect_timeout_s=PATIENCE_S,
                )
            )
            for index in range(self._tags)
        ]
        self._t0_ns = time.time_ns() // 1000 * 1000 + 200_000_000
        self._booted_ns = self._t0_ns - 1_800_000_000_000 if self._boot_clock else 0
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.finish()
        self._clients.close()

    def finish(self) -> None:
        """Stop publishing. The clients and their caches stay open."""
        self._stop.set()
        self._thread.join()

    def expected(self, config: Path) -> dict[str, Any]:
        """Return the last pose by tag (POSE) of an uninterrupted service that received all published samples."""
        settings = load_settings(config, environment={})
        bench = IngestBench(engine=create_engine(settings), site=settings.site, tags=settings.tags)
        for together in batched_by_tag(islice(self._deliveries(), self._sent)):
            for delivery in together:
                bench.put(tag_name(delivery.tag), Frame(imu=delivery.imu, ranges=delivery.ranges))
            bench.ingest.turn()
        found = {tag.name: bench.latest.row(tag.row) for tag in bench.tags.all()}
        return {name: pose for name, pose in found.items() if pose is not None}

    def _deliveries(self) -> Iterator[Delivery]:
        return deliveries(self._tags, "yard", self._seed, preset("calibrated"), self._t0_ns, self._step_s)

    def _run(self) -> None:
        every = self._deliveries()
        while not self._stop.is_set():
            delivery = next(every)  # one message
            self._stop.wait(max(0.0, self._t0_ns * 1e-9 + delivery.due_s - time.time()))
            self._publish(delivery)

    def _publish(self, delivery: Delivery) -> None:
        client = self._opened[delivery.tag]
        ahead_ns = self.clock_ns[tag_name(delivery.tag)] - self._booted_ns
        for imu in delivery.imu:
            client.publish_imu(imu.acc, imu.gyro, imu.mag, t_ns=imu.t_ns + ahead_ns)
        for sample in delivery.ranges:
            client.publish_range(sample.anchor, sample.range_m, t_ns=sample.t_ns + ahead_ns, std_m=sample.std_m)
        client.flush()
        self._sent += 1
        self.samples[tag_name(delivery.tag)].update(imu=len(delivery.imu), range=len(delivery.ranges))


def batched_by_tag(every: Iterable[Delivery]) -> Iterator[list[Delivery]]:
    """Group consecutive deliveries, so that no group has two of one tag."""
    together: dict[int, Delivery] = {}
    for delivery in every:
        if delivery.tag in together:
            yield list(together.values())
            together = {}
        together[delivery.tag] = delivery
    yield list(together.values())


def distance(pose: Any, answer: dict[str, Any]) -> float:
    """Return the distance in m between a pose (one POSE) and a pose of the REST API."""
    return float(np.hypot(pose["x"] - answer["x"], pose["y"] - answer["y"]))


def samples_of(service: Running) -> dict[str, dict[str, int]]:
    """Return the number of samples that reached the estimators, by tag and kind."""
    return {status["tag"]: status["samples"] for status in service.get("/api/v1/tags")["tags"]}


def poses_of(service: Running) -> dict[str, Any]:
    """Return the poses of the REST API, by tag."""
    return {pose["tag"]: pose for pose in service.get("/api/v1/poses")["poses"]}


def fused(expected: Mapping[str, Any], read: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return the poses that `read` returns by tag, once they are as new as those expected.

    Samples are counted before they are fused, so that their number says nothing about the poses.
    """
    wait_until(lambda: all(pose["t_ns"] <= read()[tag]["t_ns"] for tag, pose in expected.items()))
    return read()


def is_current(service: Running, tags: int) -> bool:
    """Return whether `tags` tags have a pose, all of them younger than 0.5 s."""
    time.sleep(0.05)  # limits the load that polling puts on the service
    poses = service.get("/api/v1/poses")["poses"]
    return len(poses) == tags and max(pose["age_s"] for pose in poses) < 0.5
