"""Recordings of many phones with one app, from posted messages to payloads of the tags."""

import json
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from threading import Lock
from typing import Generic, Protocol, TypeVar

from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, ImuSample, PressureSample, encode_packed
from dropanchor_tag_client.sources.phones.pairing import Signs
from dropanchor_tag_client.sources.phones.readings import PhoneError, require_utc
from dropanchor_tag_client.sources.phones.session import WAIT_S, Taken

SESSIONS_PER_TAG = 2
MAX_SESSIONS = 2000
SAMPLES_PER_PAYLOAD = 1000
MAX_SPAN_NS = 1_000_000_000_000  # of the samples in one payload
BATTERY_S = 30.0  # report the charge of a battery that does not change this often

Receive = Callable[[str, bytes, str], None]
"""Takes a payload in as if it had come over Zenoh: the tag's id, the payload, its encoding."""


class Posted(Protocol):
    """One message of an app, with the name of its recording. damaged: readings that make no sense."""

    @property
    def session_id(self) -> str: ...

    @property
    def damaged(self) -> int: ...

    @property
    def battery_fraction(self) -> float | None: ...

    @property
    def pressures(self) -> Sequence[PressureSample]: ...


M = TypeVar("M", bound=Posted)
In = TypeVar("In", bound=Posted, contravariant=True)


class Session(Protocol[In]):
    """One recording: its messages in their order, each once. Times are monotonic, in s."""

    @property
    def waiting_since_s(self) -> float | None: ...

    def take(self, message: In, now_s: float) -> Taken: ...

    def release(self, arrived_s: float) -> Taken: ...


@dataclass(frozen=True)
class Outcome:
    """What became of a posted message. unpaired: gyroscope readings without an acceleration at their time. damaged:
    readings that make no sense. waiting: messages that wait for one that was sent before them."""

    samples: int = 0
    unpaired: int = 0
    damaged: int = 0
    duplicate: bool = False
    waiting: int = 0


@dataclass
class _Recording(Generic[M]):
    """A session and its publisher's numbers."""

    tag: str
    session: Session[M]
    boot_id: int = field(default_factory=lambda: secrets.randbelow(2**32 - 1) + 1)
    sequence: Iterator[int] = field(default_factory=count)
    lock: Lock = field(default_factory=Lock)
    battery: tuple[float, float] | None = None  # the charge that was reported last, and when


class PhoneIntake(Generic[M]):
    """Its methods may be called from any thread.

    receive, receive_health: take samples and health of a tag. parse: returns a message, None for a test of the
    connection; raises PhoneError. new_session: makes the session of a recording.
    """

    def __init__(
        self,
        receive: Receive,
        receive_health: Receive,
        parse: Callable[[bytes], M | None],
        new_session: Callable[[Signs], Session[M]],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._receive = receive
        self._receive_health = receive_health
        self._parse = parse
        self._new_session = new_session
        self._clock = clock
        self._lock = Lock()
        self._recordings: OrderedDict[tuple[str, str], _Recording[M]] = OrderedDict()

    def post(self, tag: str, body: bytes, signs: Signs = Signs.AUTO) -> Outcome:
        """Take a message of the phone that is this tag. Raises PhoneError, and PhoneTimeError."""
        try:
            message = self._parse(body)
        except PhoneError:
            self._receive(tag, body, ENCODING_JSON)  # it is no payload either: the service counts why, for this tag
            raise
        if message is None:
            return Outcome()
        recording = self._recording(tag, message.session_id, signs)
        with recording.lock:
            taken = recording.session.take(message, self._clock())
            self._publish(recording, taken.samples)
            if not taken.duplicate:
                self._publish_pressures(recording, message.pressures)
                self._report(recording, message.battery_fraction)
        require_utc(taken.samples)  # after they were passed on: the service counts them, and says so on the page
        if taken.problem:
            raise PhoneError(taken.problem)
        return Outcome(len(taken.samples), taken.unpaired, message.damaged, taken.duplicate, taken.waiting)

    def release_overdue(self) -> None:
        """Stop waiting for messages that are missing for too long."""
        with self._lock:
            recordings = list(self._recordings.values())
        for recording in recordings:
            self._release(recording, self._clock() - WAIT_S)

    def _recording(self, tag: str, session_id: str, signs: Signs) -> _Recording[M]:
        """Return the recording, a new one in the place of the tag's or the service's least recently used."""
        key = tag, session_id
        with self._lock:
            known = self._recordings.pop(key, None)
            recording = self._recordings[key] = known or _Recording(tag, self._new_session(signs))
            crowded_out = [] if known else self._crowded_out(tag)
        for ended in crowded_out:
            self._release(ended, self._clock())
        return recording

    def _crowded_out(self, tag: str) -> list[_Recording[M]]:
        of_tag = [key for key in self._recordings if key[0] == tag]
        surplus = of_tag[: max(0, len(of_tag) - SESSIONS_PER_TAG)]
        if not surplus and len(self._recordings) > MAX_SESSIONS:
            surplus = [next(iter(self._recordings))]
        return [self._recordings.pop(key) for key in surplus]

    def _release(self, recording: _Recording[M], arrived_s: float) -> None:
        with recording.lock:
            if recording.session.waiting_since_s is not None:
                taken = recording.session.release(arrived_s)
                self._publish(recording, taken.samples)

    def _publish(self, recording: _Recording[M], samples: list[ImuSample]) -> None:
        for part in _parts(samples):
            frame = Frame(imu=part, sequence=next(recording.sequence), boot_id=recording.boot_id)
            self._receive(recording.tag, encode_packed(frame), ENCODING_PACKED)

    def _publish_pressures(self, recording: _Recording[M], pressures: Sequence[PressureSample]) -> None:
        """Pass pressures on as they come: they wait for no other sensor."""
        for start in range(0, len(pressures), SAMPLES_PER_PAYLOAD):
            part = list(pressures[start : start + SAMPLES_PER_PAYLOAD])
            frame = Frame(pressures=part, sequence=next(recording.sequence), boot_id=recording.boot_id)
            self._receive(recording.tag, encode_packed(frame), ENCODING_PACKED)

    def _report(self, recording: _Recording[M], battery_fraction: float | None) -> None:
        """Pass on the charge of the phone's battery if it has changed or was reported a while ago."""
        if battery_fraction is None:
            return
        now_s, last = self._clock(), recording.battery
        if last is None or last[0] != battery_fraction or now_s - last[1] >= BATTERY_S:
            recording.battery = battery_fraction, now_s
            payload = json.dumps({"battery_fraction": battery_fraction}).encode()
            self._receive_health(recording.tag, payload, ENCODING_JSON)


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
