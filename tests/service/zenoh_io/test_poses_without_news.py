"""A subscriber that comes while no tag moves still gets the poses that there are, and before it none are looked for."""

import time

import orjson
import zenoh

from dropanchor_schemas.keys import pose_key, poses_key
from dropanchor_schemas.wire import Frame, RangeSample
from dropanchor_service.answers.of_sites import answers_of_sites
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.zenoh_io.publishers import ZenohPoses
from support.ingest import IngestBench
from support.zenoh_router import connected_session, wait_until


class CountingPoses(ZenohPoses):
    """Counts how often it has looked for news and subscribers."""

    looks = 0

    @property
    def is_awake(self) -> bool:
        return self._news.is_set()

    def publish(self) -> None:
        super().publish()
        self.looks += 1


def test_the_first_subscriber_to_frames_gets_one_although_nothing_changes(router_endpoint: str) -> None:
    bench = IngestBench()
    answers = answers_of_sites(bench.sites, bench.latest, time.time_ns, [None], bench.publishers)
    frames: list[zenoh.Sample] = []
    with (
        connected_session(router_endpoint) as ours,
        connected_session(router_endpoint) as theirs,
        CountingPoses(ours, answers, Metrics()) as poses,
    ):
        wait_until(lambda: poses.looks == 1)  # it has found no subscriber, and sleeps
        bench.send("cart", Frame(ranges=[RangeSample(time.time_ns(), 7, 4.0)]))
        subscriber = theirs.declare_subscriber(poses_key("default"), frames.append)
        wait_until(lambda: frames)
        subscriber.undeclare()
    assert orjson.loads(frames[0].payload.to_bytes())["x"] == [4.0]


def test_nobody_looks_for_news_while_nobody_subscribes(router_endpoint: str) -> None:
    bench = IngestBench()
    answers = answers_of_sites(bench.sites, bench.latest, time.time_ns, [None], bench.publishers)
    heard: list[zenoh.Sample] = []
    with (
        connected_session(router_endpoint) as ours,
        connected_session(router_endpoint) as theirs,
        CountingPoses(ours, answers, Metrics()) as poses,
    ):
        wait_until(lambda: poses.looks == 1)
        bench.send("cart", Frame(ranges=[RangeSample(time.time_ns(), 7, 4.0)]))
        assert not poses.is_awake
        subscriber = theirs.declare_subscriber(pose_key("default", "cart"), heard.append)
        wait_until(lambda: poses.looks == 2)
        bench.send("cart", Frame(ranges=[RangeSample(time.time_ns(), 7, 5.0)]))
        wait_until(lambda: heard)
        subscriber.undeclare()
    assert [orjson.loads(pose.payload.to_bytes())["x"] for pose in heard] == [5.0]
