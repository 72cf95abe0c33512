"""The buffer between receiving and fusing is bounded, fair, and safe from floods of unregistered tags."""

import threading
from collections import Counter
from collections.abc import Iterable

import numpy as np

from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, HeadingSample, RangeSample, encode_packed
from dropanchor_service.ingest.backlog import MESSAGE_OVERHEAD, Message
from dropanchor_service.ingest.buffer import (
    PER_TURN_OF_TAG,
    UNREGISTERED_BYTES,
    UNREGISTERED_PER_TURN,
    MessageBuffer,
)

S = 1_000_000_000
PAYLOAD = b"x" * (1000 - MESSAGE_OVERHEAD)  # a message counts 1,000 bytes


def put(buffer: MessageBuffer, key: str, number: int) -> None:
    buffer.append(key, PAYLOAD, "e", number)


def drain_all(buffer: MessageBuffer, now_ns: int = 0) -> list[Message]:
    """Drain until nothing of registered tags is left."""
    taken: list[Message] = []
    while more := buffer.drain(10**9, now_ns)[0]:
        taken += more
    return taken


def admit(buffer: MessageBuffer, keys: Iterable[str]) -> None:
    """Register the keys with the rows 0, 1, …"""
    for row, key in enumerate(keys):
        buffer.admit(key, row)


def test_messages_are_drained_in_the_order_of_arrival() -> None:
    buffer = MessageBuffer(10**6)
    admit(buffer, "ab")
    for number in range(10):
        put(buffer, "ab"[number % 2], number)
    assert [message[3] for message in buffer.drain(4)[0]] == [0, 1, 2, 3]
    assert [message[::3] for message in buffer.drain(100)[0]] == [(0, 4), (1, 5), (0, 6), (1, 7), (0, 8), (1, 9)]
    assert buffer.drain(1) == ([], [])


def test_a_full_buffer_sheds_the_oldest_messages_of_the_busiest_tag_only() -> None:
    buffer = MessageBuffer(100_000)
    quiet = [f"quiet{i}" for i in range(10)]
    admit(buffer, ["busy", *quiet])
    for key in quiet:
        put(buffer, key, -1)
    for number in range(1000):
        put(buffer, "busy", number)
    shed, _, unregistered = buffer.take_shed()
    messages = drain_all(buffer)
    busy = [message[3] for message in messages if message[0] == 0]
    assert busy == list(range(1000 - len(busy), 1000))
    assert 60 <= len(busy) <= 90
    assert shed == {0: 1000 - len(busy)}
    assert Counter(message[0] for message in messages if message[0] != 0) == dict.fromkeys(range(1, 11), 1)
    assert unregistered == 0


def test_equally_busy_tags_lose_equally() -> None:
    buffer = MessageBuffer(100_000)
    keys = [str(i) for i in range(10)]
    admit(buffer, keys)
    for number in range(500):
        for key in keys:
            put(buffer, key, number)
    shed = buffer.take_shed().by_row
    kept = Counter(message[0] for message in drain_all(buffer))
    assert sum(shed.values()) + sum(kept.values()) == 5000
    assert max(kept.values()) - min(kept.values()) <= 1


def overload(
    buffer: MessageBuffer, seconds: float, keys: list[str], per_turn: int, limit: int = 100, since_s: float = 0.0
) -> list[Message]:
    """Drain `limit` messages every 10 ms, while `per_turn` messages of these keys arrive, one key after the other."""
    taken: list[Message] = []
    for turn in range(round(seconds * 100)):
        now_ns = turn * 10_000_000 + round(since_s * S)
        for number in range(turn * per_turn, (turn + 1) * per_turn):
            buffer.append(keys[number % len(keys)], PAYLOAD, "e", now_ns)
        taken += buffer.drain(limit, now_ns)[0]
    return taken


def test_an_overloaded_buffer_keeps_the_newest_quarter_of_a_second() -> None:
    buffer = MessageBuffer(10**9)
    keys = [str(i) for i in range(10)]
    admit(buffer, keys)
    taken = overload(buffer, 0.5, keys, 300)
    assert not buffer.take_shed().by_row
    taken += overload(buffer, 4.0, keys, 300)
    assert buffer.depth <= 0.3 * 100 * 100
    assert buffer.drain(1, 4 * S)[0][0][3] > 3.7 * S
    lost = buffer.take_shed().by_row
    assert len(taken) + 1 + sum(lost.values()) + buffer.depth == 450 * 300
    assert max(lost.values()) - min(lost.values()) < 100


def test_an_overload_is_recognised_at_once_when_it_continues_after_a_pause() -> None:
    buffer = MessageBuffer(10**9)
    keys = [str(i) for i in range(10)]
    admit(buffer, keys)
    overload(buffer, 2.0, keys, 300)
    drain_all(buffer, 2 * S)
    overload(buffer, 0.45, keys, 300, since_s=2.1)
    assert buffer.depth <= 0.3 * 100 * 100
    drain_all(buffer, 3 * S)
    buffer.take_shed()
    drain_all(buffer, 5 * S)
    overload(buffer, 0.45, keys, 300, since_s=5.1)
    assert not buffer.take_shed().by_row


def test_in_an_overload_of_more_tags_than_are_taken_in_that_time_they_take_turns() -> None:
    buffer = MessageBuffer(10**9)
    keys = [str(i) for i in range(6000)]
    admit(buffer, keys)
    times: dict[int, list[int]] = {}
    for number, message in enumerate(overload(buffer, 6.0, keys, 300)):
        if number >= 20_000:
            times.setdefault(message[0], []).append(message[3])
    assert len(times) == len(keys)
    assert max(max(np.diff(of_tag)) for of_tag in times.values()) <= 0.9 * S
    assert max(map(len, times.values())) - min(map(len, times.values())) <= 2
    assert buffer.depth <= len(keys)


def test_a_tag_that_floods_loses_only_its_own_messages() -> None:
    buffer = MessageBuffer(10**9)
    admit(buffer, ["flood", *map(str, range(50))])
    keys = ["flood"] * 2950 + [str(i) for i in range(50)]
    taken = overload(buffer, 5.0, keys, 300)
    assert set(buffer.take_shed().by_row) == {0}
    assert Counter(message[0] for message in taken)[50] >= 45


def test_a_message_behind_the_burst_of_another_tag_is_taken_by_the_next_drain() -> None:
    buffer = MessageBuffer(10**9)
    admit(buffer, ["burst", "other"])
    for number in range(20_000):
        put(buffer, "burst", number)
    put(buffer, "other", 20_000)
    taken, _ = buffer.drain(2000)
    assert Counter(message[0] for message in taken) == {0: PER_TURN_OF_TAG, 1: 1}
    assert buffer.behind == {0}


def test_a_burst_of_one_tag_is_worked_off_and_not_shed() -> None:
    buffer = MessageBuffer(10**9)
    admit(buffer, ["burst", "other"])
    for number in range(20_000):
        put(buffer, "burst", number)
    taken = overload(buffer, 15.0, ["other"], 1)
    assert not buffer.take_shed().by_row
    assert [message[3] for message in taken if message[0] == 0 and message[3]] == list(range(1, 20_000))
    assert buffer.depth == 0


def test_an_old_backlog_is_no_overload_while_it_shrinks() -> None:
    buffer = MessageBuffer(10**9)
    keys = [str(i) for i in range(10)]
    admit(buffer, keys)
    for number in range(20_000):
        buffer.append(keys[number % 10], PAYLOAD, "e", -10 * S + number * S // 2000)
    overload(buffer, 6.0, keys, 60)
    assert buffer.depth == 0
    assert not buffer.take_shed().by_row


def test_messages_from_caches_and_those_behind_them_are_never_shed() -> None:
    buffer = MessageBuffer(10**9)
    keys = [str(i) for i in range(10)]
    admit(buffer, keys)
    overload(buffer, 0.4, keys, 90)
    for number in range(20_000):
        buffer.append(keys[number % 10], PAYLOAD, "e", -10 * S, cached=True)
    taken = overload(buffer, 12.0, keys, 80)
    assert len(taken) == 20_000 + 1200 * 80
    assert not buffer.take_shed().by_row


def test_a_buffer_full_of_single_messages_sheds_the_oldest() -> None:
    buffer = MessageBuffer(100_000)
    keys = [str(i) for i in range(150)]
    admit(buffer, keys)
    for number, key in enumerate(keys):
        put(buffer, key, number)
    kept = [message[3] for message in buffer.drain(1000)[0]]
    assert 60 <= len(kept) <= 130
    assert kept == list(range(150 - len(kept), 150))


def test_the_samples_of_shed_messages_are_counted() -> None:
    buffer = MessageBuffer(10_000)
    admit(buffer, "a")
    payload = encode_packed(Frame(ranges=[RangeSample(1, 7, 1.0)] * 3, headings=[HeadingSample(1, 1.0)] * 2))
    for number in range(100):
        buffer.append("a", payload, ENCODING_PACKED, number)
        buffer.append("a", b"{}", ENCODING_JSON, number)
    by_row, samples, _ = buffer.take_shed()
    assert 50 < by_row[0] < 200
    assert abs(samples - 5 * by_row[0] / 2) <= 5


def test_messages_of_unregistered_tags_displace_only_each_other() -> None:
    buffer = MessageBuffer(10**6)
    admit(buffer, ["known"])
    put(buffer, "known", 0)
    for number in range(100_000):
        put(buffer, f"new{number}", number)
    shed = buffer.take_shed().unregistered
    messages, unregistered = buffer.drain(10**9)
    assert [message[0] for message in messages] == [0]
    assert len(unregistered) == UNREGISTERED_PER_TURN
    while more := buffer.drain(10**9)[1]:
        assert len(more) <= UNREGISTERED_PER_TURN
        unregistered += more
    assert not buffer.wait(0.0)
    assert len(unregistered) == 100_000 - shed
    assert len(unregistered) * MESSAGE_OVERHEAD < UNREGISTERED_BYTES
    assert unregistered[-1][0] == "new99999"


def test_waiting_ends_with_a_message_and_starts_again_once_all_are_drained() -> None:
    buffer = MessageBuffer(10**6)
    admit(buffer, ["a"])
    assert not buffer.wait(0.0)
    threading.Timer(0.02, put, (buffer, "a", 1)).start()
    assert buffer.wait(60.0)
    buffer.drain(1)
    assert not buffer.wait(0.0)


def test_no_message_is_lost_or_duplicated_between_threads() -> None:
    buffer = MessageBuffer(10**9)
    admit(buffer, [str(i) for i in range(4)])

    def put_many(key: str) -> None:
        for number in range(2000):
            put(buffer, key, number)

    threads = [threading.Thread(target=put_many, args=(str(i),)) for i in range(4)]
    for thread in threads:
        thread.start()
    found: Counter[int] = Counter()
    while any(thread.is_alive() for thread in threads) or buffer.depth:
        found.update(message[0] for message in buffer.drain(100)[0])
    assert found == dict.fromkeys(range(4), 2000)


def test_a_wake_ends_one_wait_also_when_it_comes_before_the_drain() -> None:
    buffer = MessageBuffer(10_000)
    assert not buffer.wait(0.0)
    buffer.wake()
    buffer.drain(10)
    assert buffer.wait(0.0)
    buffer.drain(10)
    assert not buffer.wait(0.0)
