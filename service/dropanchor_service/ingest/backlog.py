"""Messages that a turn left behind: a queue for each tag, of which the turns take by fair shares."""

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from itertools import chain
from operator import itemgetter

import numpy as np

from dropanchor_service.estimation.columns import Array

Message = tuple[int, bytes, str, int]
"""Row of the tag, payload, encoding, arrival (UTC, ns)."""

MESSAGE_OVERHEAD = 200  # bytes that a buffered message takes beside its payload
ROW, PAYLOAD, ARRIVAL = itemgetter(0), itemgetter(1), itemgetter(3)


class Backlog:
    """The caller makes calls exclude each other."""

    def __init__(self) -> None:
        self._queues: dict[int, deque[Message]] = {}
        self._turns: deque[int] = deque()  # rows with messages; the first one has been unserved for longest
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def rows(self) -> frozenset[int]:
        """Rows with messages."""
        return frozenset(self._queues)

    def add(self, messages: list[Message]) -> None:
        """Add messages, the oldest first."""
        for message in messages:
            queue = self._queues.get(message[0])
            if queue is None:
                queue = self._queues[message[0]] = deque()
                self._turns.append(message[0])
            queue.append(message)
        self._count += len(messages)

    def take(self, limit: int, share: int) -> list[Message]:
        """Take out up to `limit` messages, one of each tag in turn, and up to `share` of a tag, by their arrival."""
        taken: list[Message] = []
        of_row: Counter[int] = Counter()
        served: list[int] = []
        while self._turns and len(taken) < limit:
            row = self._turns.popleft()
            queue = self._queues[row]
            taken.append(queue.popleft())
            of_row[row] += 1
            if not queue:
                del self._queues[row]
            else:
                (served if of_row[row] == share else self._turns).append(row)
        self._turns.extend(served)
        self._count -= len(taken)
        taken.sort(key=ARRIVAL)
        return taken

    def oldest_ns(self, share: int) -> int:
        """Return the arrival of the oldest message of the tags with no more than their share, or of all tags."""
        within = [queue[0][3] for queue in self._queues.values() if len(queue) <= share]
        return min(within or (queue[0][3] for queue in self._queues.values()))

    def of_a_turn(self, share: int) -> int:
        """Return how many messages a turn without a limit would take."""
        return sum(min(len(queue), share) for queue in self._queues.values())

    def columns(self) -> tuple[Array, Array]:
        """Return the row and the size of each message. Those of a tag are in their order."""
        messages = list(chain.from_iterable(self._queues.values()))
        sizes = np.fromiter(map(len, map(PAYLOAD, messages)), np.int64, len(messages)) + MESSAGE_OVERHEAD
        return np.fromiter(map(ROW, messages), np.int64, len(messages)), sizes

    def arrivals(self) -> Array:
        """Return the arrival of each message, in the order of `columns`."""
        return np.fromiter(map(ARRIVAL, chain.from_iterable(self._queues.values())), np.int64, self._count)

    def move_arrivals(self, by_ns: int) -> None:
        """Follow the service's clock, which was moved."""
        self._queues = {row: deque(moved(queue, by_ns)) for row, queue in self._queues.items()}

    def drop(self, rows: Array) -> list[Message]:
        """Take out the oldest message of a tag for each time that its row is in `rows`."""
        dropped: list[Message] = []
        for row, times in Counter(rows.tolist()).items():
            queue = self._queues[row]
            dropped += [queue.popleft() for _ in range(times)]
            if not queue:
                del self._queues[row]
                self._turns.remove(row)
        self._count -= len(dropped)
        return dropped


def moved(messages: Iterable[Message], by_ns: int) -> Iterator[Message]:
    """Yield these messages as if they had arrived later, or earlier if `by_ns` is negative."""
    return ((row, payload, encoding, arrival_ns + by_ns) for row, payload, encoding, arrival_ns in messages)


def most_of_a_row(messages: Iterable[Message]) -> int:
    """Return how many of these messages are of the same tag, at most."""
    return max(Counter(map(ROW, messages)).values(), default=0)
