"""The client of one tag. It takes raw samples one by one and sends them in batches."""

import logging
import math
import os
import threading
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, Self, Unpack

import zenoh

from dropanchor_schemas.file_names import file_name_of
from dropanchor_schemas.health import encode_health
from dropanchor_schemas.kinds import Sample
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    Frame,
    ImuSample,
    Reason,
    encode_json,
    encode_packed,
)
from dropanchor_tag_client.buffer import SampleBuffer, rejection_reason
from dropanchor_tag_client.calibration import Calibration
from dropanchor_tag_client.credentials import connection_of
from dropanchor_tag_client.health import HealthValues, reportable
from dropanchor_tag_client.link import TagKeys
from dropanchor_tag_client.publisher import Publisher, declare_publisher
from dropanchor_tag_client.remote import Decimator, RemoteSettings
from dropanchor_tag_client.sample_methods import SampleMethods
from dropanchor_tag_client.session import DEFAULT_CONNECT, SessionSettings, SharedSession, open_session

if TYPE_CHECKING:
    from dropanchor_tag_client.spooling import SpoolCounts, SpoolingPublisher

_MAX_BATCH = 50  # about 8 kB in JSON, the limit that routers in the field are configured for

_log = logging.getLogger(__name__)


class Sent(NamedTuple):
    """What the client has sent since it was created."""

    samples: int
    messages: int
    payload_bytes: int


class TagClient(SampleMethods):
    """Publish the raw samples of one tag. Use the client as a context manager. All methods are thread-safe.

    connect: the endpoint of the router; `SessionSettings` (TLS, password); or an open session, which several tags of
        one process can share and which the client does not close. Credentials of another tag raise OtherTagError.
    clock: what `t_ns` counts from: "utc" (1970) or "boot" (any start that is fixed until `boot_id` changes).
    batch_samples, batch_s: the client sends a message when it has this many samples, or when its first sample is this
        old. With batch_s=None no thread watches the time: call `flush`.
    cache_messages: number of messages to keep for a service that missed them. Nothing is lost in an outage of the
        router or the service as long as they cover the gap. 0 publishes without a cache.
    replay: whether the samples come from a recording. The service then counts ages from the time of the recording.
    wait_when_congested: wait for a slow router instead of dropping messages. Do not use this for live data.
    connect_timeout_s: how long `open` waits for the router before it raises ConnectError. With None it waits without a
        limit and logs a warning. An open client always reconnects by itself, and publishing never blocks.
    spool: a folder for the messages of outages that are longer than the cache, or than the process lives. `open` then
        does not wait for the router. The oldest messages are deleted beyond `spool_limit_bytes`.
    calibration: of the IMU, applied to its samples. The encoding of the messages says so.
    """

    _session: zenoh.Session | None = None
    _publisher: Publisher | None = None
    _spooling: "SpoolingPublisher | None" = None
    _token: zenoh.LivelinessToken | None = None
    _timer: threading.Thread | None = None
    _decimator: Decimator | None = None
    wanted: RemoteSettings | None = None
    _applied: RemoteSettings | None = None
    _due_s = math.inf
    _sent = Sent(0, 0, 0)

    def __init__(
        self,
        tag: str,
        *,
        site: str = "default",
        connect: str | SessionSettings | SharedSession | zenoh.Session = DEFAULT_CONNECT,
        encoding: Literal["packed", "json"] = "packed",
        clock: Literal["utc", "boot"] = "utc",
        batch_samples: int = 20,
        batch_s: float | None = 0.1,
        replay: bool = False,
        cache_messages: int = 600,
        wait_when_congested: bool = False,
        connect_timeout_s: float | None = None,
        spool: str | Path | None = None,
        spool_limit_bytes: int = 100_000_000,
        calibration: Calibration | None = None,
    ) -> None:
        if not 1 <= batch_samples <= _MAX_BATCH:
            raise ValueError(f"batch_samples is {batch_samples}; 1 to {_MAX_BATCH} was expected")
        if spool is not None and (clock != "utc" or cache_messages == 0 or connect_timeout_s is not None):
            raise ValueError(
                "a spool needs clock='utc' and a cache, and no connect_timeout_s: it tries without a limit"
            )
        self.tag = tag
        self.boot_id = int.from_bytes(os.urandom(4), "little") or 1
        self.refused: Counter[Reason] = Counter()
        self.keys = TagKeys.of(site, tag)
        self._connect = connection_of(connect, site, tag)
        self._packed = encoding == "packed"
        self._calibration = calibration
        self._boot_clock = clock == "boot"
        self._replay = replay
        self._batch_s = self._own_batch_s = batch_s
        self._batch_samples = batch_samples
        self._cache_messages = cache_messages
        self._wait_when_congested = wait_when_congested
        self._connect_timeout_s = connect_timeout_s
        self._spool = None if spool is None else Path(spool, file_name_of(site), file_name_of(tag))
        self._spool_limit_bytes = spool_limit_bytes
        self._buffer = SampleBuffer(batch_samples)
        self._condition = threading.Condition()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self) -> None:
        """Connect to the router. Raises ConnectError if that takes longer than `connect_timeout_s`, and SpoolError."""
        if self._publisher is not None:
            raise RuntimeError(f"the client of tag {self.tag!r} is already open")
        if self._spool is not None:
            self._publisher = self._spooling = self._opened_spool(self._spool)
        else:
            if isinstance(self._connect, SessionSettings):
                self._session = open_session(self._connect, self._connect_timeout_s)
            else:
                self._session = self._connect
            self._publisher = self._declare_publisher(self._session)
            self._token = self._session.liveliness().declare_token(self.keys.alive)
        if self._batch_s is not None:
            self._timer = threading.Thread(target=self._flush_when_due, name=f"flush {self.tag}", daemon=True)
            self._timer.start()

    def close(self) -> None:
        """Send the buffered samples and disconnect. Closing a closed client does nothing."""
        with self._condition:
            if self._publisher is None:
                return
            self._send()
            publisher, self._publisher = self._publisher, None
            self._condition.notify_all()
        if self._timer is not None:
            self._timer.join()
        if self._token is not None:
            self._token.undeclare()
        publisher.undeclare()
        if self._session is not None and isinstance(self._connect, SessionSettings):
            self._session.close()

    def publish_health(self, **values: Unpack[HealthValues]) -> bool:
        """Report what is known about the tag, and what its spool holds. Return whether it could be sent.

        About once a minute is enough; `Upkeep` does it. Values that no tag can measure are counted in `refused`.
        """
        with self._condition:
            report, session = reportable(values, self.spool_counts, self._applied, self.refused), self.session
            if session is None or not report:
                return False
            session.put(self.keys.health, encode_health(report), encoding=ENCODING_JSON)
        return True

    def apply(self, settings: RemoteSettings) -> None:
        """Apply what the service sets for this tag; what is None is as the program said.

        A message still has at most 50 samples. A client without a batch time is flushed by its program, so that the
        service cannot change it.
        """
        with self._condition:
            self.wanted = settings
            batch_s = None if self._own_batch_s is None else settings.batch_s
            self._batch_s = self._own_batch_s if batch_s is None else batch_s
            self._buffer.max_samples = self._batch_samples if batch_s is None else _MAX_BATCH
            self._decimator = None if settings.imu_hz is None else Decimator(settings.imu_hz)
            self._applied = RemoteSettings(batch_s, settings.imu_hz)

    def flush(self) -> None:
        """Send all buffered samples now."""
        with self._condition:
            self._send()

    @property
    def sent(self) -> Sent:
        """Return what the client has sent since it was created."""
        return self._sent

    @property
    def session(self) -> zenoh.Session | None:
        """Return the session of the open client; with a spool, None until it is connected."""
        if self._publisher is None:
            return None
        return self._session if self._spooling is None else self._spooling.session

    @property
    def spool_counts(self) -> "SpoolCounts | None":
        """Return what the spool holds and has lost, None without a spool."""
        return None if self._spooling is None else self._spooling.counts

    def _opened_spool(self, folder: Path) -> "SpoolingPublisher":
        # imported here because a client without a spool saves the memory of these modules
        from dropanchor_tag_client.spool import Spool
        from dropanchor_tag_client.spooling import SpoolingPublisher

        return SpoolingPublisher(
            Spool(folder, self._spool_limit_bytes),
            self._connect,
            self.keys,
            self._declare_publisher,
            self._cache_messages,
            "" if self._calibration is None else f";{self._calibration.label}",
        )

    def _declare_publisher(self, session: zenoh.Session) -> Publisher:
        encoding = ENCODING_PACKED if self._packed else ENCODING_JSON
        if self._calibration is not None:
            encoding += f";{self._calibration.label}"
        return declare_publisher(
            session,
            self.keys.samples,
            encoding,
            cache_messages=self._cache_messages,
            wait_when_congested=self._wait_when_congested,
        )

    def _add(self, sample: Sample, anchor: int | str | None = None) -> None:
        with self._condition:
            if self._publisher is None:
                raise RuntimeError(f"the client of tag {self.tag!r} is not open: use it with `with`")
            if reason := rejection_reason(sample):
                self._refuse(reason)
                return
            if self._decimator is not None and isinstance(sample, ImuSample):
                mean = self._decimator.add(sample)
                if mean is None:
                    return
                sample = mean
            if not self._buffer.accepts(sample.t_ns):
                self._send()
            self._buffer.add(sample, anchor)
            if self._buffer.is_full:
                self._send()
            elif len(self._buffer) == 1 and self._batch_s is not None:
                self._due_s = time.monotonic() + self._batch_s
                self._condition.notify_all()

    def _refuse(self, reason: Reason) -> None:
        self.refused[reason] += 1
        if self.refused[reason] == 1:
            _log.warning("tag %s: dropped a sample (%s); more are only counted, in `refused`", self.tag, reason)

    def _send(self) -> None:
        """Send the buffered samples. The caller holds the lock."""
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
            _log.error("tag %s: could not send a message: %s", self.tag, error)

    def _payload(self, frame: Frame) -> bytes:
        frame.sequence, frame.boot_id = self._sent.messages % 2**32, self.boot_id
        frame.boot_clock = self._boot_clock
        frame.replay = self._replay
        return encode_packed(frame) if self._packed else encode_json(frame)

    def _flush_when_due(self) -> None:
        with self._condition:
            while self._publisher is not None:
                left_s = self._due_s - time.monotonic()
                if left_s <= 0:
                    self._send()
                else:
                    self._condition.wait(None if left_s == math.inf else left_s)
