"""One recording of Sensor Logger: its messages in the order of their numbers, each once."""

from typing import NamedTuple

from dropanchor_schemas.wire import ImuSample
from dropanchor_tag_client.sources.phones.pairing import Paired, Pairing, Signs
from dropanchor_tag_client.sources.phones.sensor_logger import Message

WAIT_S = 2.0  # for a message that is missing before others
MAX_WAITING = 16
FIRST = 8  # a recording that is heard from a message below this on has begun just now: those before it are awaited
REMEMBERED = 1024  # newest message ids; older ones count as known


class Taken(NamedTuple):
    """What became of a message. samples: those that are complete now. waiting: messages that wait for one before."""

    samples: list[ImuSample]
    unpaired: int
    problem: str
    duplicate: bool
    waiting: int


class Session:
    """Times are monotonic, in s."""

    def __init__(self, signs: Signs) -> None:
        self._pairing = Pairing(signs)
        self._next: int | None = None
        self._known: set[int] = set()
        self._waiting: dict[int, tuple[Message, float]] = {}

    def take(self, message: Message, now_s: float) -> Taken:
        """Take a message, and those that waited for it."""
        if self._is_known(message.message_id):
            return self._taken([], duplicate=True)
        self._known.add(message.message_id)
        if self._next is None:
            self._next = 0 if message.message_id < FIRST else message.message_id
        if message.message_id < self._next:  # it was given up; the readings around it are gone
            return self._taken([self._pairing.beginning_anew().add(message.streams, message.damage)])
        self._waiting[message.message_id] = message, now_s
        return self.release(now_s - WAIT_S)

    def release(self, arrived_s: float) -> Taken:
        """Take the messages that are in order. Skip what is missing before messages that arrived until `arrived_s`."""
        paired = []
        while (following := self._following(arrived_s)) is not None:
            message, _ = self._waiting.pop(following)
            paired.append(self._pairing.add(message.streams, message.damage))
            self._next = following + 1
        oldest = self._newest - REMEMBERED
        self._known = {known for known in self._known if known > oldest}
        return self._taken(paired)

    @property
    def waiting_since_s(self) -> float | None:
        """When the message that has waited longest arrived; None when none waits."""
        return min((arrived_s for _, arrived_s in self._waiting.values()), default=None)

    @property
    def _newest(self) -> int:
        return max(self._known, default=0)

    def _is_known(self, message_id: int) -> bool:
        return message_id in self._known or message_id <= self._newest - REMEMBERED

    def _following(self, arrived_s: float) -> int | None:
        """Return the id of the message that comes next; None when it is to be waited for."""
        if self._next in self._waiting:
            return self._next
        oldest_s = self.waiting_since_s
        gives_up = oldest_s is not None and (oldest_s <= arrived_s or len(self._waiting) > MAX_WAITING)
        return min(self._waiting) if gives_up else None

    def _taken(self, paired: list[Paired], duplicate: bool = False) -> Taken:
        return taken_of(paired, len(self._waiting), duplicate)


def taken_of(paired: list[Paired], waiting: int, duplicate: bool) -> Taken:
    """Return what became of a message whose readings were paired like this."""
    return Taken(
        [sample for part in paired for sample in part.samples],
        sum(part.unpaired for part in paired),
        next((part.problem for part in reversed(paired)), ""),
        duplicate,
        waiting,
    )
