"""One recording of phyphox: its messages in the order of their readings, each reading once.

The app numbers no messages. Every reading is in one message only, so that a step between the readings of two messages
tells that one is missing between them. A pause of the experiment looks the same.
"""

from collections.abc import Mapping

from dropanchor_service.phones.phyphox import Message
from dropanchor_tag_client.sources.phones.pairing import Paired, Pairing, Signs
from dropanchor_tag_client.sources.phones.readings import GYROSCOPE
from dropanchor_tag_client.sources.phones.session import MAX_WAITING, WAIT_S, Taken, taken_of
from dropanchor_tag_client.sources.phones.streams import Stream, make_stream

STEP_NS = 100_000_000  # between two readings of the gyroscope where none is missing; messages are 200 ms long
BEGUN_NS = 1_000_000_000  # after the start of the experiment; a first message that is later is not the first
REMEMBERED_NS = 60_000_000_000  # older readings of the gyroscope count as known

Streams = Mapping[str, Stream]


class PhyphoxSession:
    """Times are monotonic, in s. Readings have UTC in ns."""

    def __init__(self) -> None:
        self._pairing = Pairing(Signs.ANDROID)
        self._end_ns: int | None = None  # of the gyroscope's last reading that was not held back
        self._known: set[int] = set()  # times of the gyroscope's readings
        self._waiting: dict[int, tuple[Streams, float]] = {}  # by the time of the gyroscope's first reading

    def take(self, message: Message, now_s: float) -> Taken:
        """Take a message, and those that waited for it."""
        gyroscope = message.streams.get(GYROSCOPE)
        if gyroscope is None:
            return self._taken([self._pairing.add(message.streams)])
        fresh = self._without_known(gyroscope)
        if not fresh:
            return self._taken([], duplicate=True)
        first_ns, streams = fresh.t_ns[0], {**message.streams, GYROSCOPE: fresh}
        if self._end_ns is None:
            start_ns = message.start_ns
            self._end_ns = start_ns if first_ns - start_ns < BEGUN_NS else first_ns
        if first_ns < self._end_ns:  # it was given up; the readings around it are gone
            return self._taken([self._pairing.beginning_anew().add(streams)])
        self._waiting[first_ns] = streams, now_s
        return self.release(now_s - WAIT_S)

    def release(self, arrived_s: float) -> Taken:
        """Take the messages that are in order. Skip what is missing before messages that arrived until `arrived_s`."""
        paired = []
        while (following := self._following(arrived_s)) is not None:
            streams, _ = self._waiting.pop(following)
            paired.append(self._pairing.add(streams))
            self._end_ns = streams[GYROSCOPE].newest_ns
        return self._taken(paired)

    @property
    def waiting_since_s(self) -> float | None:
        """When the message that has waited longest arrived; None when none waits."""
        return min((arrived_s for _, arrived_s in self._waiting.values()), default=None)

    def _without_known(self, gyroscope: Stream) -> Stream:
        """Return the readings that have not come before, and remember them."""
        oldest_ns = max(gyroscope.newest_ns, max(self._known, default=0)) - REMEMBERED_NS
        fresh = make_stream(one for one in gyroscope.readings() if one[0] > oldest_ns and one[0] not in self._known)
        self._known = {t_ns for t_ns in self._known.union(gyroscope.t_ns) if t_ns > oldest_ns}
        return fresh

    def _following(self, arrived_s: float) -> int | None:
        """Return the key of the message that comes next; None when it is to be waited for."""
        if not self._waiting or self._end_ns is None:
            return None
        earliest = min(self._waiting)
        oldest_s = self.waiting_since_s
        gives_up = oldest_s is not None and (oldest_s <= arrived_s or len(self._waiting) > MAX_WAITING)
        return earliest if gives_up or earliest - self._end_ns <= STEP_NS else None

    def _taken(self, paired: list[Paired], duplicate: bool = False) -> Taken:
        return taken_of(paired, len(self._waiting), duplicate)._replace(problem="")  # the experiment needs the sensors
