"""The buffer between receiving and fusing: bounded, fair, and deaf to floods of strangers."""

import threading
from collections import Counter
from collections.abc import Iterable

from dropanchor_service.buffer import MESSAGE_OVERHEAD, MOST_WAIT_S, STRANGER_BYTES, STRANGERS_PER_TURN, MessageBuffer

PAYLOAD = b"x" * (1000 - MESSAGE_OVERHEAD)  # a message counts 1,000 bytes


def put(buffer: MessageBuffer, key: str, number: int) -> None:
    buffer.append(key, PAYLOAD, "e", number)


def admit(buffer: MessageBuffer, keys: Iterable[str]) -> None:
    """Their rows are 0, 1, …"""
    for row, key in enumerate(keys):
        buffer.admit(key, row)


def test_messages_come_out_in_the_order_in_which_they_came() -> None:
    buffer = MessageBuffer(10**6)
    admit(buffer, "ab")
    for number in range(10):
        put(buffer, "ab"[number % 2], number)
    assert [message[3] for message in buffer.drain(4)[0]] == [0, 1, 2, 3]
    assert [message[::3] for message in buffer.drain(100)[0]] == [(0, 4), (1, 5), (0, 6), (1, 7), (0, 8), (1, 9)]
    assert buffer.drain(1) == ([], [])


def test_when_it_is_full_the_busiest_tag_loses_its_oldest_and_the_quiet_ones_lose_nothing() -> None:
    buffer = MessageBuffer(100_000)
    quiet = [f"quiet{i}" for i in range(10)]
    admit(buffer, ["busy", *quiet])
    for key in quiet:
        put(buffer, key, -1)
    for number in range(1000):
        put(buffer, "busy", number)
    shed, strangers = buffer.take_shed()
    messages, _ = buffer.drain(10**9)
    busy = [message[3] for message in messages if message[0] == 0]
    assert busy == list(range(1000 - len(busy), 1000))
    assert 60 <= len(busy) <= 90
    assert shed == {0: 1000 - len(busy)}
    assert Counter(message[0] for message in messages if message[0] != 0) == dict.fromkeys(range(1, 11), 1)
    assert strangers == 0


def test_equally_busy_tags_lose_equally() -> None:
    buffer = MessageBuffer(100_000)
    keys = [str(i) for i in range(10)]
    admit(buffer, keys)
    for number in range(500):
        for key in keys:
            put(buffer, key, number)
    shed, _ = buffer.take_shed()
    kept = Counter(message[0] for message in buffer.drain(10**9)[0])
    assert sum(shed.values()) + sum(kept.values()) == 5000
    assert max(kept.values()) - min(kept.values()) <= 1


def drained(buffer: MessageBuffer, seconds: float, arrivals_per_turn: int, from_ns: int = 0) -> int:
    """A turn every 10 ms takes 100 messages while `arrivals_per_turn` come in; returns how many were shed."""
    for turn in range(round(seconds * 100)):
        now_ns = from_ns + turn * 10_000_000
        for number in range(arrivals_per_turn):
            buffer.append(str(number % 10), PAYLOAD, "e", now_ns)
        buffer.drain(100, now_ns)
    return sum(buffer.take_shed()[0].values())


def test_in_an_overload_no_more_waits_than_is_taken_in_half_a_second_and_the_newest_is_kept() -> None:
    buffer = MessageBuffer(10**9)
    admit(buffer, map(str, range(10)))
    assert drained(buffer, 0.9, 300) == 0
    assert drained(buffer, 4.0, 300, from_ns=900_000_000) > 10_000
    assert buffer.depth <= MOST_WAIT_S * 100 * 100 + 300
    oldest = buffer.drain(1, 4_900_000_000)[0][0]
    assert oldest[3] > 4_200_000_000


def test_a_burst_and_what_was_cached_elsewhere_are_no_overload() -> None:
    buffer = MessageBuffer(10**9)
    admit(buffer, map(str, range(10)))
    for number in range(20_000):
        buffer.append(str(number % 10), PAYLOAD, "e", -10_000_000_000 + number)
    assert drained(buffer, 4.0, 50) == 0


def test_strangers_push_out_only_each_other() -> None:
    buffer = MessageBuffer(10**6)
    admit(buffer, ["known"])
    put(buffer, "known", 0)
    for number in range(100_000):
        put(buffer, f"stranger{number}", number)
    shed = buffer.take_shed()[1]
    messages, strangers = buffer.drain(10**9)
    assert [message[0] for message in messages] == [0]
    assert len(strangers) == STRANGERS_PER_TURN
    while more := buffer.drain(10**9)[1]:
        assert len(more) <= STRANGERS_PER_TURN
        strangers += more
    assert not buffer.wait(0.0)
    assert len(strangers) == 100_000 - shed
    assert len(strangers) * MESSAGE_OVERHEAD < STRANGER_BYTES
    assert strangers[-1][0] == "stranger99999"


def test_waiting_ends_when_a_message_comes_and_goes_on_when_all_are_taken() -> None:
    buffer = MessageBuffer(10**6)
    admit(buffer, ["a"])
    assert not buffer.wait(0.0)
    threading.Timer(0.02, put, (buffer, "a", 1)).start()
    assert buffer.wait(5.0)
    buffer.drain(1)
    assert not buffer.wait(0.0)


def test_nothing_is_lost_or_doubled_between_threads() -> None:
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
