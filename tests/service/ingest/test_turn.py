"""The way from messages to poses: order, duplicates, clocks, settings. Losses are counted, and no fault spreads."""

from collections.abc import Callable

import numpy as np
import pytest

from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    Frame,
    HeadingSample,
    ImuSample,
    RangeSample,
    encode_json,
    encode_packed,
)
from dropanchor_service.answers.answers import Answers
from dropanchor_service.estimation.columns import SampleBatch, State, StateReason
from dropanchor_service.ingest import samples as sample_reader
from dropanchor_service.ingest.decode import Forms, read_forms
from dropanchor_service.ingest.quarantine import FAULTS_BEFORE_QUARANTINE
from service.ingest.messages import S, T, ranges
from support.ingest import IngestBench

IMU = ImuSample(T, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0))


def test_samples_of_several_tags_reach_the_engine_in_one_batch_and_become_poses() -> None:
    bench = IngestBench()
    bench.put("a", ranges(1.0, 2.0))
    bench.put("b", Frame(ranges=[RangeSample(T, 7, 5.0)], imu=[IMU, IMU], headings=[HeadingSample(T, 1.0)]))
    bench.ingest.turn()
    assert len(bench.engine.batches) == 1
    assert bench.x_of("ab") == [2.0, 5.0]
    b = bench.tags.find("b")
    assert b is not None
    assert b.samples == {"imu": 2, "range": 1, "heading": 1}
    assert b.messages == 1
    assert bench.rejected() == {}


def test_json_and_packed_messages_give_the_same_poses() -> None:
    bench = IngestBench()
    bench.put("a", encode_json(ranges(3.0)), ENCODING_JSON)
    bench.put("b", ranges(3.0))
    bench.ingest.turn()
    assert bench.x_of("ab") == [3.0, 3.0]


def test_bad_samples_of_a_frame_are_counted_for_their_tag_and_good_ones_are_kept() -> None:
    bench = IngestBench()
    bench.send("a", ranges(1.0, -1.0, float("nan"), 9000.0, 2.0))
    tag = bench.tags.find("a")
    assert tag is not None
    assert tag.samples == {"range": 2}
    assert tag.rejected == {"range_negative": 1, "not_finite": 1, "range_absurd": 1}
    assert bench.rejected() == tag.rejected
    assert bench.x_of("a") == [2.0]


@pytest.mark.parametrize(
    ("payload", "encoding", "reason"),
    [
        (b"", "application/vnd.dropanchor.samples", "payload_empty"),
        (b"\x01", "application/vnd.dropanchor.samples", "header_truncated"),
        (b"\x02" + bytes(31), "application/vnd.dropanchor.samples", "version_unknown"),
        (b"\x01\x80" + bytes(30), "application/vnd.dropanchor.samples", "flags_unknown"),
        (b"\x01" + bytes(31), "application/vnd.dropanchor.samples", "no_samples"),
        (b"\x01" + bytes(40), "application/vnd.dropanchor.samples", "length_mismatch"),
        (bytes(70_000), "application/vnd.dropanchor.samples", "payload_too_large"),
        (b"{", "application/json", "json_syntax"),
        (b"[]", "application/json", "json_schema"),
        (b"{}", "application/json", "no_samples"),
        (b'{"version":2}', "application/json", "version_unknown"),
        (b"x", "zenoh/bytes", "encoding_unknown"),
    ],
)
def test_a_bad_payload_is_counted_for_its_tag_and_others_pass(payload: bytes, encoding: str, reason: str) -> None:
    bench = IngestBench()
    bench.put("good", ranges(1.0))
    bench.put("bad", payload, encoding)
    bench.put("good", ranges(2.0))
    bench.ingest.turn()
    tag = bench.tags.find("bad")
    assert tag is not None
    assert tag.rejected == {reason: 1}
    assert bench.rejected() == {reason: 1}
    assert bench.x_of(["good"]) == [2.0]


@pytest.mark.parametrize(
    "key", ["dropanchor/@v1/default/tag/%zz/samples", "elsewhere", "dropanchor/@v1/default/tag/a%2d/samples"]
)
def test_a_key_that_does_not_follow_the_contract_is_counted(key: str) -> None:
    bench = IngestBench()
    bench.buffer.append(key, encode_packed(ranges(1.0)), "application/vnd.dropanchor.samples", T)
    bench.ingest.turn()
    assert bench.rejected() == {"key_invalid": 1}
    assert len(bench.tags) == 0


def test_a_message_that_arrives_twice_is_fused_once() -> None:
    bench = IngestBench()
    first, second = ranges(1.0, sequence=0, boot_id=5), ranges(2.0, sequence=1, boot_id=5)
    bench.send("a", first, second, first)
    bench.send("a", second, first)
    assert sum(len(batch.ranges) for batch in bench.engine.batches) == 2
    assert bench.rejected() == {"duplicate": 3}


def test_a_gap_is_filled_from_a_backlog_however_old_it_is() -> None:
    bench = IngestBench()
    bench.send("a", ranges(1.0, sequence=0, boot_id=1))
    now_ns = bench.clock.now_ns()
    for sequence, ago_ns in ((2, 900_000_000), (1, 800_000_000), (4, 700_000_000)):
        bench.put("a", ranges(1.0, sequence=sequence, boot_id=1), at_ns=now_ns - ago_ns)
    fused_counts = []
    for _ in range(4):
        bench.ingest.turn(limit=1)
        fused_counts.append(bench.total(bench.metrics.samples))
    assert fused_counts == [1, 3, 3, 4]
    assert bench.total(bench.metrics.given_up) == 1


def test_each_publisher_and_each_tag_has_its_own_sequence() -> None:
    bench = IngestBench()
    bench.send("a", ranges(1.0, sequence=0, boot_id=5), ranges(1.0, sequence=0, boot_id=6))
    bench.send("b", ranges(1.0, sequence=0, boot_id=5))
    assert sum(len(batch.ranges) for batch in bench.engine.batches) == 3
    assert bench.rejected() == {}


def test_times_of_a_tag_that_counts_from_its_start_become_utc() -> None:
    bench = IngestBench()
    second = 1_000_000_000
    for number, tag_s, arrival_s in ((0, 1.0, 101.0), (1, 2.0, 102.5), (2, 3.0, 103.0)):
        frame = Frame(ranges=[RangeSample(int(tag_s * second), 7, 1.0)], boot_clock=True, boot_id=9, sequence=number)
        bench.put("a", frame, at_ns=T + int(arrival_s * second))
    bench.ingest.turn()
    times = [int(batch.ranges["t_ns"][0]) - T for batch in bench.engine.batches]
    assert times == [101 * second, 102 * second, 103 * second]


def test_settings_of_a_tag_reach_the_engine_before_its_first_message_and_when_they_change() -> None:
    bench = IngestBench(tags={"a": {"height_m": 1.5}})
    bench.ingest.turn()
    assert list(bench.engine.configured) == [0]
    bench.send("a", ranges(1.0))
    bench.send("b", ranges(1.0))
    bench.site.set_tag("a", TagSettings(height_m=2.5))
    bench.ingest.turn()
    assert [float(settings["height"]) for settings in bench.engine.configured[0]] == [1.5, 2.5]
    assert len(bench.engine.configured[1]) == 1


def test_a_name_a_colour_and_a_group_do_not_restart_a_tag_and_a_start_does() -> None:
    bench = IngestBench()
    bench.send("a", ranges(1.0))
    bench.site.set_tag("a", TagSettings(name="Forklift", colour="#0b62b8", group="forklifts"))
    bench.ingest.turn()
    assert len(bench.engine.configured[0]) == 1
    start = StartPose(x=2.0, y=3.0, heading_rad=0.5)
    bench.site.set_tag("a", TagSettings(name="Forklift", start=start))
    bench.ingest.turn()
    _, settings = bench.engine.configured[0]
    assert [float(settings[f"start_{name}"]) for name in ("x", "y", "heading")] == [2.0, 3.0, 0.5]


def test_a_deleted_tag_is_back_with_its_next_message() -> None:
    bench = IngestBench()
    bench.send("a", ranges(1.0))
    tag = bench.tags.rows.at(0)
    bench.tags.delete(0)
    assert (bench.tags.listed(), tag.messages) == ([], 0)
    bench.send("a", ranges(2.0))
    assert (bench.tags.listed(), tag.messages) == ([tag], 1)


def poison_row(row: int) -> Callable[[SampleBatch], bool]:
    def poisoned(samples: SampleBatch) -> bool:
        return row in samples.ranges["row"]

    return poisoned


def test_a_row_that_makes_the_engine_fail_is_lost_and_stops_no_other_row() -> None:
    bench = IngestBench(tags={"2": {"start": StartPose(x=1.0, y=1.0).model_dump()}})
    names = [str(i) for i in range(8)]
    for name in names:
        bench.send(name, ranges(1.0))
    poisoned = bench.tags.find("2")
    assert poisoned is not None
    bench.engine.poisoned = poison_row(poisoned.row)
    for name in names:
        bench.put(name, ranges(2.0))
    bench.ingest.turn()
    others = [name for name in names if name != "2"]
    assert bench.x_of(others) == [2.0] * 7
    pose = bench.latest.row(poisoned.row)
    assert pose is not None
    assert [pose["state"].item(), pose["reason"].item()] == [State.LOST, StateReason.FAULT]
    assert np.isnan(pose["x"])
    first, afresh = bench.engine.configured[poisoned.row]
    assert first["start_known"]
    assert not afresh["start_known"]


def test_a_row_that_fails_repeatedly_is_quarantined_and_its_samples_are_counted() -> None:
    bench = IngestBench()
    bench.send("a", ranges(1.0))
    bench.engine.poisoned = poison_row(0)
    for _ in range(FAULTS_BEFORE_QUARANTINE + 4):
        bench.send("a", ranges(1.0))
    assert bench.rejected() == {"estimator_fault": 4}
    assert bench.faults() == {"estimator": FAULTS_BEFORE_QUARANTINE}


def test_a_payload_that_makes_the_decoder_fail_harms_no_other_payload(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(payloads: list[bytes], encodings: list[str]) -> Forms:
        if b"poison" in payloads:
            raise RuntimeError("a bug")
        return read_forms(payloads, encodings)

    monkeypatch.setattr(sample_reader, "read_forms", fails)
    bench = IngestBench()
    bench.send("a", ranges(1.0), b"poison", ranges(2.0))
    assert bench.x_of("a") == [2.0]
    assert bench.rejected() == {"payload_empty": 1}


def test_shed_messages_are_counted_for_their_tag() -> None:
    bench = IngestBench(capacity=100_000)
    bench.send("busy", ranges(1.0))
    bench.send("quiet", ranges(1.0))
    bench.put("quiet", ranges(2.0))
    for _ in range(1000):
        bench.put("busy", ranges(3.0))
    while bench.buffer.depth:
        bench.ingest.turn()
    bench.ingest.turn()
    busy, quiet = bench.tags.find("busy"), bench.tags.find("quiet")
    assert busy is not None
    assert quiet is not None
    assert busy.rejected["shed"] + busy.messages == 1001
    assert busy.rejected["shed"] > 0
    assert quiet.messages == 2


def test_the_age_of_a_replay_counts_from_its_arrival_and_that_of_a_live_tag_from_its_samples() -> None:
    bench = IngestBench()
    answers = Answers(bench.site, bench.tags, bench.latest, bench.clock.now_ns)

    def state_of(name: str, later_s: float = 0.0) -> tuple[str, float]:
        """Return state and age at a time after the last message, however long compiling has taken."""
        tag = bench.tags.find(name)
        assert tag is not None
        assert tag.last_heard_ns is not None
        now_ns = tag.last_heard_ns + int(later_s * S)
        answers.now_ns = lambda: now_ns
        pose = answers.pose_of(tag)
        assert pose is not None
        return pose["state"], pose["age_s"]

    bench.send("live", ranges(1.0))
    bench.send("replayed", ranges(1.0).replaced(replay=True))
    assert state_of("live")[0] == "lost"
    state, age_s = state_of("replayed")
    assert state == "tracking"
    assert age_s == pytest.approx(0.0, abs=0.5)
    assert state_of("replayed", 5.0)[0] == "coasting"
    assert state_of("replayed", 15.0)[0] == "lost"
    bench.send("replayed", ranges(2.0))
    assert state_of("replayed")[0] == "lost"
