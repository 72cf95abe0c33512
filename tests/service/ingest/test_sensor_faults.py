"""What the service says and does about a tag whose sensors fail their check."""

from pathlib import Path
from typing import Any

import pytest

from dropanchor_schemas.wire import Frame, ImuSample, RangeSample, encode_packed
from dropanchor_service.answers.care import care_of
from dropanchor_service.answers.hints import hints_of
from dropanchor_service.estimation.columns import State, StateReason
from support.ingest import IngestBench
from support.sensor_faults import GRAVITY
from support.traffic import T0_NS

SITE = {"id": "default", "anchors": [{"id": "1"}]}
STEP_NS = 200_000_000


def frames(number: int, begin: int = 0, acc: float = GRAVITY, scale: float = 1.0) -> list[Frame]:
    """Return messages of 0.2 s of a tag that lies still, 5 m away. acc: along body z. scale: of the ranges."""
    made = []
    for step in range(begin, begin + number):
        times = [T0_NS + step * STEP_NS + i * 10_000_000 for i in range(20)]
        imu = [ImuSample(t, (0.01 * (i % 3), 0.0, acc), (0.001 * (i % 2), 0.0, 0.0)) for i, t in enumerate(times)]
        ranges = [RangeSample(times[0], 1, 5.0 * scale), RangeSample(times[10], 1, 5.01 * scale)]
        made.append(Frame(imu=imu, ranges=ranges, sequence=step, boot_id=7))
    return made


def sent(*frames_of_tag: Frame, **options: Any) -> IngestBench:
    bench = IngestBench(site=SITE, **options)
    send(bench, *frames_of_tag)
    return bench


def send(bench: IngestBench, *frames_of_tag: Frame, tag: str = "a") -> None:
    for frame in frames_of_tag:
        bench.put(tag, encode_packed(frame), at_ns=frame.ranges[-1].t_ns + 100_000_000)
        bench.ingest.turn()


def state_of(bench: IngestBench, tag: str = "a") -> tuple[int, int]:
    pose = bench.latest.row(bench.tags.register(tag).row)
    assert pose is not None
    return int(pose["state"]), int(pose["reason"])


def hint_of(bench: IngestBench) -> str:
    poses = bench.latest.since()[1]
    texts, index = hints_of(poses, bench.site, bench.tags, int(poses["t_ns"][0]))
    return str(texts[index[0]])


def test_accelerations_in_g_are_named_and_never_reach_the_engine() -> None:
    bench = sent(*frames(20, acc=1.0))
    assert state_of(bench) == (State.INITIALISING, StateReason.SENSOR_FAULT)
    assert "look like g" in hint_of(bench)
    assert sum(len(batch.imu) for batch in bench.engine.batches) <= 60
    assert bench.rejected()["sensor_fault"] > 300
    (care,) = care_of(bench.tags.register("a"), bench.health, T0_NS)
    assert care["reason"] == "sensor_fault"
    assert care["setting"] == {"acc_unit": "g"}


def test_the_accepted_unit_converts_what_comes_from_then_on() -> None:
    bench = sent(*frames(20, acc=1.0))
    bench.site.set_tag("a", bench.site.tag_settings("a").model_copy(update={"acc_unit": "g"}))
    send(bench, *frames(20, begin=20, acc=1.0))
    assert state_of(bench)[0] == State.TRACKING
    assert bench.engine.batches[-1].imu["acc"][0, 2] == pytest.approx(GRAVITY)
    assert care_of(bench.tags.register("a"), bench.health, T0_NS) == []


def test_a_fault_that_ends_lets_the_tag_start_anew() -> None:
    bench = sent(*frames(10), *frames(20, begin=10, acc=1.0), *frames(30, begin=30))
    assert state_of(bench)[0] == State.TRACKING
    row = bench.tags.register("a").row
    assert len(bench.engine.configured[row]) == 2
    assert not bench.engine.configured[row][-1]["start_known"]


def test_raw_counts_are_named_although_every_sample_is_rejected() -> None:
    bench = sent(*frames(20, acc=16384.0))
    assert state_of(bench) == (State.INITIALISING, StateReason.SENSOR_FAULT)
    assert "raw counts" in hint_of(bench)


def test_ranges_in_millimetres_may_be_told() -> None:
    tags = {"a": {"range_unit": "mm"}}
    bench = sent(*frames(10, scale=1000.0), tags=tags)
    assert bench.x_of(["a"]) == [pytest.approx(5.01)]
    assert bench.rejected() == {}


def test_a_neighbour_is_the_same_to_the_last_bit() -> None:
    alone, beside = sent(*frames(20)), IngestBench(site=SITE)
    for good, bad in zip(frames(20), frames(20, acc=1.0), strict=True):
        send(beside, bad, tag="b")
        send(beside, good, tag="a")
    assert beside.x_of(["a"]) == alone.x_of(["a"])
    of_a = beside.tags.register("a").row
    assert b"".join(
        batch.imu[batch.imu["row"] == of_a]["acc"].tobytes() for batch in beside.engine.batches
    ) == b"".join(batch.imu["acc"].tobytes() for batch in alone.engine.batches)


def test_a_checkpoint_keeps_the_verdict(tmp_path: Path) -> None:
    from dropanchor_service.estimation.fleet.engine import FleetEngine

    bench = IngestBench(site=SITE, engine=FleetEngine(), folder=tmp_path / "a")
    send(bench, *frames(10, acc=1.0))
    again = IngestBench(site=SITE, engine=FleetEngine(), folder=tmp_path / "b")
    again.service_state().restore(bench.service_state().snapshot())
    send(again, *frames(1, begin=10, acc=1.0))
    assert state_of(again) == (State.INITIALISING, StateReason.SENSOR_FAULT)
