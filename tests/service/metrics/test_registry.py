"""Prometheus can scrape the metrics of the ingest and the store."""

import numpy as np
from prometheus_client import generate_latest

from dropanchor_schemas.wire import Frame as Message
from dropanchor_schemas.wire import RangeSample, Reason
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, Frame, State
from dropanchor_service.metrics.registry import FleetGauges, Metrics
from dropanchor_service.store import LatestPoses
from support.ingest import IngestBench
from support.sites import make_sites

S = 1_000_000_000
T = 1_760_000_000 * S


def lines(metrics: Metrics) -> dict[str, float]:
    text = generate_latest(metrics.registry).decode()
    return {key: float(value) for key, value in (line.rsplit(" ", 1) for line in text.splitlines() if line[0] != "#")}


def test_samples_rejections_and_times_are_counted() -> None:
    bench = IngestBench()
    bench.send("a", Message(ranges=[RangeSample(T, 7, 1.0), RangeSample(T, 7, -1.0)]))
    found = lines(bench.metrics)
    assert found['dropanchor_samples_total{kind="range"}'] == 1
    assert found['dropanchor_rejected_total{reason="range_negative"}'] == 1
    assert found["dropanchor_messages_total"] == found["dropanchor_poses_total"] == 1
    assert found["dropanchor_estimator_seconds_count"] == found["dropanchor_pose_delay_seconds_count"] == 1


def test_every_rejection_reason_is_exported_from_the_start_so_that_rates_work() -> None:
    found = lines(Metrics())
    assert all(found[f'dropanchor_rejected_total{{reason="{reason}"}}'] == 0 for reason in Reason)


def test_tags_are_counted_by_their_aged_state_rather_than_the_stored_one() -> None:
    sites, latest, metrics = make_sites(), LatestPoses(), Metrics()
    site = sites[0]
    poses = np.zeros(4, POSE)
    poses["row"], poses["state"] = [0, 1, 2, 3], State.TRACKING
    poses["t_ns"] = [100 * S, 97 * S, 50 * S, 100 * S]
    poses["frame"][3] = Frame.RELATIVE
    latest.write(poses, np.empty(0, HYPOTHESIS))
    for name in "abcd":
        site.tags.register(name)
    site.tags.presence.set_token("a", True)
    site.pending_tags.on_message("e", 100 * S)
    metrics.register(FleetGauges(sites, latest, lambda: 100 * S, lambda: 5))
    found = lines(metrics)
    states = {
        state: found[f'dropanchor_tags{{state="{state}"}}'] for state in ("relative", "tracking", "coasting", "lost")
    }
    assert states == dict.fromkeys(states, 1)
    assert found["dropanchor_tags_registered"] == 4
    assert found["dropanchor_tags_pending"] == found["dropanchor_newcomers"] == 1
    assert found["dropanchor_tags_online"] == 1
    assert found["dropanchor_queue_messages"] == 5
