"""The client of one tag: takes raw samples one by one, sends them in batches."""

import logging
import math
import os
import threading
import time
from collections import Counter
from collections.abc import Sequence
from operator import index
from types import TracebackType
from typing import Literal, NamedTuple, Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    BearingSample,
    Frame,
    HeadingSample,
    ImuSample,
    RangeSample,
    Reason,
    Vector,
    anchor_number,
    encode_json,
    encode_packed,
)
from dropanchor_tag_client.buffer import Sample, SampleBuffer, unsendable
from dropanchor_tag_client.publisher import PlainPublisher, Publisher, recoverable_publisher
from dropanchor_tag_client.session import DEFAULT_CONNECT, SessionSettings, open_session

_MAX_BATCH = 50  # in JSON some 8 kB, which is what routers in the field let through

_log = logging.getLogger(__name__)


class Sent(NamedTuple):
    """Counts since the client was opened."""

    samples: int
    messages: int
    payload_bytes: int


class TagClient:
    """Publishes the raw samples of one tag. Use it with `with`; its methods may be called from any thread.

    connect: the endpoint of the router, `SessionSettings` (TLS, password), or a session that several tags of one
        process share and that stays open.
    clock: what `t_ns` counts from: "utc" (1970) or "boot" (any start that is the same until `boot_id` changes).
    batch_samples, batch_s: a message is sent when it holds that many samples, or when its first one has waited so
        long. With batch_s=None no thread watches the time: call `flush`.
    cache_messages: messages kept for a service that missed them (a killed router or service loses nothing as long as
        they cover the gap); 0 publishes plainly.
    replay: the samples are of a recording that is played now, at any speed; the service then counts ages from where
        the recording has come to.
    wait_when_congested: publishing waits for a slow router instead of dropping; not for live data.
    connect_timeout_s: how long opening waits for the router before it raises ConnectError; None: for ever, and says so
        in the log. An open client reconnects by itself for ever; its publishing never blocks.
    """

    _session: zenoh.Session | None = None
    _publisher: Publisher | None = None
    _token: zenoh.LivelinessToken | None = None
    _timer: threading.Thread | None = None
    _due_s = math.inf
    _sent = Sent(0, 0, 0)

    def __init__(
        self,
        tag: str,
        *,
        site: str = "default",
        connect: str | SessionSettings | zenoh.Session = DEFAULT_CONNECT,
        encoding: Literal["packed", "json"] = "packed",
        clock: Literal["utc", "boot"] = "utc",
        batch_samples: int = 20,
        batch_s: float | None = 0.1,
        replay: bool = False,
        cache_messages: int = 600,
        wait_when_congested: bool = False,
        connect_timeout_s: float | None = None,
    ) -> None:
        if not 1 <= batch_samples <= _MAX_BATCH:
            raise ValueError(f"batch_samples is {batch_samples}; 1 to {_MAX_BATCH} was expected")
        self.tag = tag
        self.boot_id = int.from_bytes(os.urandom(4), "little") or 1
        self.refused: Counter[Reason] = Counter()
        self._samples_key = keys.samples_key(site, tag)
        self._alive_key = keys.tag_alive_key(site, tag)
        self._connect = SessionSettings(connect=connect) if isinstance(connect, str) else connect
        self._packed = encoding == "packed"
        self._boot_clock = clock == "boot"
        self._replay = replay
        self._batch_s = batch_s
        self._cache_messages = cache_messages
        self._wait_when_congested = wait_when_congested
        self._connect_timeout_s = connect_timeout_s
        self._buffer = SampleBuffer(batch_samples)
        self._wake = threading.Condition()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def open(self) -> None:
        """Connects. Raises ConnectError when that takes longer than `connect_timeout_s`."""
        if self._publisher is not None:
            raise RuntimeError(f"the client of tag {self.tag!r} is open already")
        if isinstance(self._connect, SessionSettings):
            self._session = open_session(self._connect, self._connect_timeout_s)
        else:
            self._session = self._connect
        self._publisher = self._declare_publisher(self._session)
        self._token = self._session.liveliness().declare_token(self._alive_key)
        if self._batch_s is not None:
            self._timer = threading.Thread(target=self._flush_in_time, name=f"flush {self.tag}", daemon=True)
            self._timer.start()

    def close(self) -> None:
        """Sends what waits, then leaves. Closing twice does nothing."""
        with self._wake:
            if self._publisher is None:
                return
            self._send()
            publisher, self._publisher = self._publisher, None
            self._wake.notify_all()
        if self._timer is not None:
            self._timer.join()
        if self._token is not None:
            self._token.undeclare()
        publisher.undeclare()
        if self._session is not None and isinstance(self._connect, SessionSettings):
            self._session.close()

    def publish_range(
        self, anchor: int | str, range_m: float, *, t_ns: int | None = None, std_m: float = math.nan
    ) -> None:
        """One two-way range to an anchor, m."""
        self._add(RangeSample(self._time(t_ns), _anchor_number(anchor), float(range_m), float(std_m)), anchor)

    def publish_imu(
        self,
        acc: Sequence[float],
        gyro: Sequence[float],
        mag: Sequence[float] | None = None,
        *,
        t_ns: int | None = None,
    ) -> None:
        """One IMU sample (body frame x forward, y left, z up): specific force m/s², rate rad/s, magnetic field µT."""
        field = None if mag is None else _vector("mag", mag)
        self._add(ImuSample(self._time(t_ns), _vector("acc", acc), _vector("gyro", gyro), field))

    def publish_heading(self, heading_rad: float, *, t_ns: int | None = None, std_rad: float = math.nan) -> None:
        """A heading that the platform itself has, counter-clockwise from east, rad."""
        self._add(HeadingSample(self._time(t_ns), float(heading_rad), float(std_rad)))

    def publish_bearing(
        self, anchor: int | str, bearing_rad: float, *, t_ns: int | None = None, std_rad: float = math.nan
    ) -> None:
        """The bearing of the tag as the anchor sees it, counter-clockwise from east, rad."""
        self._add(BearingSample(self._time(t_ns), _anchor_number(anchor), float(bearing_rad), float(std_rad)), anchor)

    def flush(self) -> None:
        """Sends what waits, now."""
        with self._wake:
            self._send()

    @property
    def sent(self) -> Sent:
        return self._sent

    def _declare_publisher(self, session: zenoh.Session) -> Publisher:
        encoding = ENCODING_PACKED if self._packed else ENCODING_JSON
        if self._cache_messages == 0:
            return PlainPublisher(session, self._samples_key, encoding, wait_when_congested=self._wait_when_congested)
        return recoverable_publisher(
            session,
            self._samples_key,
            encoding,
            cache_messages=self._cache_messages,
            wait_when_congested=self._wait_when_congested,
        )

    def _time(self, t_ns: int | None) -> int:
        if t_ns is not None:
            return index(t_ns)
        return time.monotonic_ns() if self._boot_clock else time.time_ns()

    def _add(self, sample: Sample, anchor: int | str | None = None) -> None:
        with self._wake:
            if self._publisher is None:
                raise RuntimeError(f"the client of tag {self.tag!r} is not open: use it with `with`")
            if reason := unsendable(sample):
                self._refuse(reason)
                return
            if not self._buffer.spans(sample.t_ns):
                self._send()
            self._buffer.add(sample, anchor)
            if self._buffer.is_full:
                self._send()
            elif len(self._buffer) == 1 and self._batch_s is not None:
                self._due_s = time.monotonic() + self._batch_s
                self._wake.notify_all()

    def _refuse(self, reason: Reason) -> None:
        self.refused[reason] += 1
        if self.refused[reason] == 1:
            _log.warning("tag %s: a sample was left out (%s); more are counted silently", self.tag, reason)

    def _send(self) -> None:
        """Sends the frame in the making. The lock is held."""
        self._due_s = math.inf
        if not len(self._buffer) or self._publisher is None:
            return
        frame = self._buffer.take()
        payload = self._payload(frame)
        self._sent = Sent(
            self._sent.samples + len(frame), self._sent.messages + 1, self._sent.payload_bytes + len(payload)
        )
        try:
            self._publisher.put(payload)
        except zenoh.ZError as error:
            _log.error("tag %s: a message was not sent: %s", self.tag, error)

    def _payload(self, frame: Frame) -> bytes:
        frame.sequence = self._sent.messages % 2**32
        frame.boot_id = self.boot_id
        frame.boot_clock = self._boot_clock
        frame.replay = self._replay
        return encode_packed(frame) if self._packed else encode_json(frame)

    def _flush_in_time(self) -> None:
        with self._wake:
            while self._publisher is not None:
                left_s = self._due_s - time.monotonic()
                if left_s <= 0:
                    self._send()
                else:
                    self._wake.wait(None if left_s == math.inf else left_s)


def _anchor_number(anchor: int | str) -> int:
    if isinstance(anchor, str) and len(anchor) > keys.MAX_ID_LENGTH:
        raise ValueError(f"an anchor id has at most {keys.MAX_ID_LENGTH} characters")
    return anchor_number(anchor)


def _vector(name: str, values: Sequence[float]) -> Vector:
    if len(values) != 3:
        raise ValueError(f"{name} has three components, not {len(values)}")
    return float(values[0]), float(values[1]), float(values[2])
