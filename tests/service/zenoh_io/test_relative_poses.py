"""Over Zenoh, too, a tag that does not know north has no place of the site until it finds north."""

import time
from functools import partial
from typing import Any

import numpy as np
import orjson
import zenoh

from dropanchor_schemas.keys import pose_key, poses_key
from dropanchor_schemas.wire import Frame as Message
from dropanchor_schemas.wire import RangeSample
from dropanchor_service.answers.of_sites import answers_of_sites
from dropanchor_service.estimation.columns import HYPOTHESIS, Frame, State
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.zenoh_io.publishers import ZenohPoses
from dropanchor_service.zenoh_io.queryables import ZenohAnswers
from support.ingest import IngestBench
from support.zenoh_router import connected_session, wait_until

Place = tuple[Any, Any, Any]


def write(bench: IngestBench, frame: Frame) -> None:
    pose = bench.latest.since()[1]
    pose["t_ns"], pose["state"], pose["frame"], pose["x"], pose["y"] = time.time_ns(), State.TRACKING, frame, 3.0, 4.0
    bench.latest.write(pose, np.empty(0, HYPOTHESIS))


def place_in(payload: zenoh.ZBytes) -> Place:
    """Return the state, x, and x in the own frame, of a pose or of the only tag of a frame."""
    pose = {
        name: value[0] if isinstance(value, list) and name != "hypotheses" else value
        for name, value in orjson.loads(payload.to_bytes()).items()
    }
    own = pose["relative_pose"]
    return pose["state"], pose["x"], None if own is None else own["x"]


def test_a_query_and_both_publications_give_a_place_of_the_site_only_once_north_is_found(router_endpoint: str) -> None:
    bench = IngestBench()
    answers = answers_of_sites(bench.sites, bench.latest, time.time_ns, [None], bench.publishers)
    bench.send("cart", Message(ranges=[RangeSample(time.time_ns(), 7, 4.0)]))
    single, of_all = pose_key("default", "cart"), poses_key("default")
    heard: dict[str, list[Place]] = {single: [], of_all: []}

    def note(sample: zenoh.Sample) -> None:
        heard[str(sample.key_expr)].append(place_in(sample.payload))

    def both_say(frame: Frame, expected: Place) -> bool:
        write(bench, frame)  # again and again, because a publisher learns only after a while that somebody subscribes
        return all(places[-1:] == [expected] for places in heard.values())

    with (
        connected_session(router_endpoint) as ours,
        connected_session(router_endpoint) as theirs,
        ZenohPoses(ours, answers, Metrics()),
        ZenohAnswers(ours, answers, "test", Metrics()),
    ):
        write(bench, Frame.RELATIVE)
        subscribers = [theirs.declare_subscriber(key, note) for key in heard]
        for frame, expected in ((Frame.RELATIVE, ("relative", None, 3.0)), (Frame.SITE, ("tracking", 3.0, None))):
            wait_until(partial(both_say, frame, expected))
            replies = [reply.ok for reply in theirs.get(single) if reply.ok is not None]
            assert [place_in(reply.payload) for reply in replies] == [expected]
        for subscriber in subscribers:
            subscriber.undeclare()
    assert {place for places in heard.values() for place in places} == {
        ("relative", None, 3.0),
        ("tracking", 3.0, None),
    }
