"""Recordings of many phones with Sensor Logger, from pushed messages to payloads of the tags."""

import secrets
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import count
from threading import Lock

from dropanchor_schemas.wire import ENCODING_PACKED, Frame, ImuSample, encode_packed
from dropanchor_service.phones.pairing import Signs
from dropanchor_service.phones.sensor_logger import PhoneError, parse
from dropanchor_service.phones.session import WAIT_S, Session

SESSIONS_PER_TAG = 2
MAX_SESSIONS = 2000
SAMPLES_PER_PAYLOAD = 1000
MAX_SPAN_NS = 1_000_000_000_000  # of the samples in one payload

Receive = Callable[[str, bytes, str], None]
"""Takes a payload in as if it had come over Zenoh: the tag's id, the payload, its encoding."""


@dataclass(frozen=True)
class Posted:
    """What became of a pushed message. unpaired: gyroscope readings without an acceleration at their time. damaged:
    readings that make no sense. waiting: messages that wait for one that was sent before them."""

    samples: int = 0
    unpaired: int = 0
    damaged: int = 0
    duplicate: bool = False
    waiting: int = 0


@dataclass
class _Recording:
    """A session and its publisher's numbers."""

    tag: str
    session: Session
    boot_id: int = field(default_factory=lambda: secrets.randbelow(2**32 - 1) + 1)
    sequence: Iterator[int] = field(default_factory=count)
    lock: Lock = field(default_factory=Lock)


class SensorLoggerIntake:
    """Its methods may be called from any thread."""

    def __init__(self, receive: Receive, clock: Callable[[], float] = time.monotonic) -> None:
        self._receive = receive
        self._clock = clock
        self._lock = Lock()
        self._recordings: OrderedDict[tuple[str, str], _Recording] = OrderedDict()

    def post(self, tag: str, body: bytes, signs: Signs) -> Posted:
        """Take a pushed message of the phone that is this tag. Raises PhoneError."""
        message = parse(body)
        if message is None:
            return Posted()
        recording = self._recording(tag, message.session_id, signs)
        with recording.lock:
            taken = recording.session.take(message, self._clock())
            self._publish(recording, taken.samples)
        if taken.problem:
            raise PhoneError(taken.problem)
        return Posted(len(taken.samples), taken.unpaired, message.damaged, taken.duplicate, taken.waiting)

    def release_overdue(self) -> None:
        """Stop waiting for messages that are missing for too long."""
        with self._lock:
            recordings = list(self._recordings.values())
        for recording in recordings:
            self._release(recording, self._clock() - WAIT_S)

    def _recording(self, tag: str, session_id: str, signs: Signs) -> _Recording:
        """Return the recording, a new one in the place of the tag's or the service's least recently used."""
        key = tag, session_id
        with self._lock:
            known = self._recordings.pop(key, None)
            recording = self._recordings[key] = known or _Recording(tag, Session(signs))
            crowded_out = [] if known else self._crowded_out(tag)
        for ended in crowded_out:
            self._release(ended, self._clock())
        return recording

    def _crowded_out(self, tag: str) -> list[_Recording]:
        of_tag = [key for key in self._recordings if key[0] == tag]
        surplus = of_tag[: max(0, len(of_tag) - SESSIONS_PER_TAG)]
        if not surplus and len(self._recordings) > MAX_SESSIONS:
            surplus = [next(iter(self._recordings))]
        return [self._recordings.pop(key) for key in surplus]

    def _release(self, recording: _Recording, arrived_s: float) -> None:
        with recording.lock:
            if recording.session.waiting_since_s is not None:
                taken = recording.session.release(arrived_s)
                self._publish(recording, taken.samples)

    def _publish(self, recording: _Recording, samples: list[ImuSample]) -> None:
        for part in _parts(samples):
            frame = Frame(imu=part, sequence=next(recording.sequence), boot_id=recording.boot_id)
            self._receive(recording.tag, encode_packed(frame), ENCODING_PACKED)


def _parts(samples: list[ImuSample]) -> Iterator[list[ImuSample]]:
    """Samples that fit into one payload each."""
    part: list[ImuSample] = []
    for sample in samples:
        if part and (len(part) == SAMPLES_PER_PAYLOAD or abs(sample.t_ns - part[0].t_ns) > MAX_SPAN_NS):
            yield part
            part = []
        part.append(sample)
    if part:
        yield part
