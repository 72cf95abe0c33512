"""A burst of one tag delays no other tag, and numbers that jump spoil no figure."""

import random
import time
from pathlib import Path

import pytest

from dropanchor_schemas.keys import samples_key
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, RangeSample, encode_packed
from dropanchor_service.ingest.buffer import PER_TURN_OF_TAG
from dropanchor_service.ingest.due import PENDING_OF_TAG
from dropanchor_service.ingest.kernels.sequences import MESSAGES_PER_S, WINDOW
from support.ingest import IngestBench
from support.manual_clock import ManualClock
from support.service import running_service, settings_file
from support.zenoh_router import connected_session, wait_until

S = 1_000_000_000
BURST = 1000
OF_A_TURN = 2 * PER_TURN_OF_TAG + PENDING_OF_TAG  # messages of a tag that a turn can use, fresh and pending


def ranges(t_ns: int, sequence: int, boot_id: int) -> Frame:
    return Frame(ranges=[RangeSample(t_ns, 7, 5.0, 0.1)], sequence=sequence, boot_id=boot_id)


def boot_id_of(number: int, boots: str) -> int:
    return number + 1 if boots == "new" else 1


@pytest.mark.parametrize("boots", ["one", "new"])
def test_a_neighbour_is_used_in_the_turn_after_it_arrives_while_a_burst_is_worked_off(boots: str) -> None:
    bench = IngestBench(clock=(clock := ManualClock()))
    bench.send("burst", ranges(clock.t_ns, 0, 1))
    bench.send("other", ranges(clock.t_ns, 0, 77))
    for number in range(1, BURST + 1):
        bench.put("burst", ranges(clock.t_ns + number, number, boot_id_of(number, boots)))
    burst, other = bench.tags.find("burst"), bench.tags.find("other")
    assert burst is not None
    assert other is not None
    turns, before = 0, burst.samples["range"]
    while bench.buffer.depth or bench.ingest.has_pending:
        turns += 1
        clock.t_ns += S // 50
        bench.put("other", ranges(clock.t_ns, turns, 77))
        bench.ingest.turn()
        assert other.samples["range"] == turns + 1
        assert burst.samples["range"] - before <= OF_A_TURN
        before = burst.samples["range"]
    assert turns >= BURST // OF_A_TURN
    assert burst.samples["range"] == BURST + 1
    assert "shed" not in bench.rejected()
    assert bench.total(bench.metrics.given_up) == 0


def test_random_numbers_are_restarts_and_no_lost_messages() -> None:
    bench = IngestBench(clock=(clock := ManualClock()))
    dice = random.Random(3)
    for _ in range(400):
        clock.t_ns += S // 50
        bench.send("a", ranges(clock.t_ns, dice.randrange(2**32), 1))
    clock.t_ns += S
    bench.ingest.turn()
    assert bench.total(bench.metrics.given_up) <= WINDOW + 8 * MESSAGES_PER_S
    assert bench.total(bench.metrics.sequence_restarts) > 350
    assert bench.total(bench.metrics.samples) == 400


def test_what_a_tag_can_have_sent_while_it_was_away_is_lost_and_no_restart() -> None:
    bench = IngestBench(clock=(clock := ManualClock()))
    bench.send("a", ranges(clock.t_ns, 0, 1))
    clock.t_ns += 60 * S
    bench.send("a", ranges(clock.t_ns, 3000, 1), ranges(clock.t_ns, 3001, 1))
    clock.t_ns += S
    bench.ingest.turn()
    assert bench.total(bench.metrics.given_up) == 2999
    assert bench.total(bench.metrics.sequence_restarts) == 0
    assert bench.total(bench.metrics.samples) == 3


def test_a_service_uses_every_message_beside_a_burst_with_a_new_boot_id_in_each_frame(tmp_path: Path) -> None:
    """`tests/benchmarks/test_bursts.py` measures how old the pose of the neighbour becomes."""
    file = settings_file(tmp_path, ["burst", "other"])
    with (
        running_service("--config", str(file)) as service,
        connected_session(service.zenoh) as bursting,
        connected_session(service.zenoh) as session,
    ):
        now_ns = time.time_ns()
        burst = [encode_packed(ranges(now_ns + number, number, number + 1)) for number in range(BURST)]
        session.put(samples_key("default", "other"), encode_packed(ranges(now_ns, 0, 77)), encoding=ENCODING_PACKED)
        wait_until(lambda: service.get("/api/v1/tags/other")["messages"] == 1)
        for payload in burst:
            bursting.put(samples_key("default", "burst"), payload, encoding=ENCODING_PACKED)
        for number in range(1, 40):
            frame = ranges(time.time_ns(), number, 77)
            session.put(samples_key("default", "other"), encode_packed(frame), encoding=ENCODING_PACKED)
            time.sleep(0.02)
        wait_until(lambda: service.get("/api/v1/tags/other")["messages"] == 40)
        assert service.get("/api/v1/tags/other")["rejected"].get("shed", 0) == 0
        assert service.metric("dropanchor_given_up_messages_total") == 0
