"""Messages whose times cannot be UTC are refused and counted for their tag, and its hint says what they look like."""

import pytest

from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    Frame,
    ImuSample,
    RangeSample,
    encode_json,
    encode_packed,
)
from dropanchor_service.answers.answers import Answers
from support.ingest import IngestBench

S = 1_000_000_000
T = 1_760_000_000 * S
MS = 10**6


class Place:
    """An ingest, and what people are told of the tag cart."""

    def __init__(self) -> None:
        self.bench = IngestBench(site={"anchors": [{"id": "7"}]})
        self.now_ns = T
        self.answers = Answers(self.bench.site, self.bench.tags, self.bench.latest, now_ns=lambda: self.now_ns)

    def send(self, frame: Frame, encoding: str = ENCODING_PACKED) -> None:
        self.now_ns += S // 10
        payload = encode_packed(frame) if encoding == ENCODING_PACKED else encode_json(frame)
        self.bench.put("cart", payload, encoding, at_ns=self.now_ns)
        self.bench.ingest.turn()

    def hint(self) -> str:
        tag = self.bench.tags.find("cart")
        assert tag is not None
        return self.answers.hint_of(tag)

    def pose_hint(self) -> str:
        [pose] = self.answers.pose_list()["poses"]
        return str(pose["hint"])


def ranges(*times: int) -> Frame:
    return Frame(ranges=[RangeSample(t_ns, 7, 1.5) for t_ns in times])


@pytest.mark.parametrize("encoding", [ENCODING_PACKED, ENCODING_JSON])
@pytest.mark.parametrize(
    ("t_ns", "said"),
    [
        (T // S, "look like seconds, not nanoseconds: multiply them by 1000000000, or"),
        (T // MS, "look like milliseconds, not nanoseconds: multiply them by 1000000, or"),
        (T // 1000, "look like microseconds, not nanoseconds: multiply them by 1000, or"),
        (12_345_000_000, "count from a start, such as boot, not from 1970"),
    ],
)
def test_they_are_refused_and_the_hint_says_what_they_look_like(
    encoding: str, t_ns: int, said: str, caplog: pytest.LogCaptureFixture
) -> None:
    place = Place()
    for number in range(3):
        frame = ranges(t_ns, t_ns + 1000).replaced(sequence=number, boot_id=5)
        place.send(frame, encoding)
    assert place.bench.rejected() == {"time_not_utc": 6.0}
    tag = place.bench.tags.find("cart")
    assert tag is not None
    assert tag.rejected == {"time_not_utc": 6}
    assert place.bench.engine.batches == []
    assert said in place.hint()
    assert caplog.text.count("tag cart: t_ns is 1970-01-") == 1
    place.now_ns += 11 * S
    assert place.hint() == ""


@pytest.mark.parametrize("boot_id", [5, None])
def test_a_tag_that_begins_to_send_another_unit_gets_the_hint_in_its_pose(boot_id: int | None) -> None:
    place = Place()
    numbers = {"boot_id": boot_id} if boot_id else {}
    place.send(ranges(T).replaced(sequence=0, **numbers))
    assert place.bench.x_of(["cart"]) == [1.5]
    assert "look like" not in place.pose_hint()
    place.send(ranges((T + S) // MS).replaced(sequence=1, **numbers))
    assert place.bench.rejected() == {"time_not_utc": 1.0}
    assert "look like milliseconds" in place.pose_hint()


def test_the_good_samples_beside_them_are_used() -> None:
    place = Place()
    imu = [ImuSample(T // MS, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0))] * 2
    place.send(ranges(T).replaced(imu=imu), ENCODING_JSON)
    assert place.bench.rejected() == {"time_not_utc": 2.0}
    assert place.bench.x_of(["cart"]) == [1.5]


@pytest.mark.parametrize("flag", ["boot_clock", "replay"])
def test_a_boot_clock_and_a_replay_may_begin_at_zero(flag: str) -> None:
    place = Place()
    for t_ns in (0, S // 10, S // 5):
        place.send(ranges(t_ns).replaced(**{flag: True}))
    assert place.bench.rejected() == {}
    assert [len(batch.ranges) for batch in place.bench.engine.batches] == [1, 1, 1]


def test_a_tag_that_sets_its_times_right_is_used_from_then_on() -> None:
    place = Place()
    place.send(ranges(T // MS).replaced(sequence=0, boot_id=5))
    place.send(ranges(T).replaced(sequence=1, boot_id=5))
    [batch] = place.bench.engine.batches
    assert batch.ranges["t_ns"].tolist() == [T]
