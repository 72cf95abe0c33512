"""Receives samples, liveliness and health over Zenoh. Callbacks store what they get and return; they never call Zenoh.

Samples are read from a channel and not by a callback. A callback needs the interpreter lock for every message, and can
wait 5 ms for it while another thread computes. Live messages would then queue in the router, which drops them.
"""

import logging
import threading
import time
from typing import Any, Self

import zenoh
import zenoh.ext

from dropanchor_schemas.keys import InvalidKeyError, samples_key
from dropanchor_schemas.wire import payload_encoding
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.ingest.period import Period
from dropanchor_service.ingest.turn import Ingest
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store import Sites
from dropanchor_service.zenoh_io.caches import ZenohCaches
from dropanchor_service.zenoh_io.channel import drain

CHANNEL_LENGTH = 2**14  # messages between Zenoh's receive thread and ours
HEALTH_CHANNEL_LENGTH = 2**12  # reports; a flood of them loses the oldest and delays no samples
HEALTH_GATHER_S = 0.1
TOKENS_PER_TAG = 2  # liveliness tokens that a site may have, for each tag that it admits


class ZenohIntake:
    """Subscribes to the samples while it is open.

    Zenoh fetches missed messages from the publishers' caches. It holds back those that follow until it has an answer,
    for ten seconds at most: the Python API has no setting for that. For what it does not get, see `CatchUp.on_gap`.
    """

    def __init__(
        self,
        session: zenoh.Session,
        sites: Sites,
        ingest: Ingest,
        catch_up: CatchUp,
        caches: ZenohCaches,
        metrics: Metrics,
        clock: UtcClock,
        period: Period,
    ) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._session = session
        self._sites = sites
        self._ingest = ingest
        self._metrics = metrics
        self._clock = clock
        self._period = period
        self._first_ns: int | None = None  # arrival of the first message of a batch
        self._catch_up = catch_up
        self._caches = caches
        self._declared: list[Any] = []

    def __enter__(self) -> Self:
        samples = zenoh.ext.declare_advanced_subscriber(
            self._session,
            self._sites.all_tags("samples"),
            zenoh.handlers.FifoChannel(CHANNEL_LENGTH),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
        misses = samples.sample_miss_listener(zenoh.handlers.Callback(self._on_miss, indirect=False))
        tokens = self._session.liveliness().declare_subscriber(
            self._sites.all_tags("alive"),
            zenoh.handlers.Callback(self._on_token, indirect=False),
            history=True,
        )
        health = self._session.declare_subscriber(
            self._sites.all_tags("health"), zenoh.handlers.RingChannel(HEALTH_CHANNEL_LENGTH)
        )
        self._declared = [misses, samples, tokens, health]
        self._threads = [
            threading.Thread(target=self._receive_all, args=(samples.handler,), name="samples", daemon=True),
            threading.Thread(target=self._receive_health, args=(health.handler,), name="health", daemon=True),
        ]
        for thread in self._threads:
            thread.start()
        self._caches.start(self._catch_up)
        return self

    def __exit__(self, *_: object) -> None:
        self._caches.stop()
        for declared in self._declared:
            declared.undeclare()
        for thread in self._threads:
            thread.join(1.0)

    def _receive_all(self, samples: Any) -> None:
        """Pass on messages until the subscriber is undeclared."""
        for message in drain(samples, self._gather):
            self._receive(message)

    def _gather(self, has_first: bool) -> None:
        self._first_ns = self._clock.now_ns() if has_first else None
        time.sleep(self._period.gathering_s)

    def _receive(self, message: zenoh.Sample) -> None:
        now_ns, self._first_ns = self._first_ns or self._clock.now_ns(), None
        key = str(message.key_expr)
        encoding = payload_encoding(str(message.encoding))
        if self._sites.serves(key):
            self._catch_up.on_live(key, bytes(message.payload), encoding, now_ns)

    def _receive_health(self, reports: Any) -> None:
        """Pass on health until the subscriber is undeclared."""
        for report in drain(reports, lambda _: time.sleep(HEALTH_GATHER_S)):
            encoding, key = payload_encoding(str(report.encoding)).partition(";")[0], str(report.key_expr)
            if self._sites.serves(key):
                self._ingest.health.put(key, bytes(report.payload), encoding, self._clock.now_ns())

    def _on_miss(self, miss: zenoh.ext.Miss) -> None:
        self._metrics.misses.inc(miss.nb)
        text = (
            f"Zenoh did not recover {miss.nb} messages of one publisher; if they are numbered, its cache is asked again"
        )
        self._log.warning("messages are missing", text)

    def _on_token(self, message: zenoh.Sample) -> None:
        try:
            site, name = self._sites.of_key(str(message.key_expr))
        except InvalidKeyError:
            return
        presence, key = site.tags.presence, samples_key(site.id, name)
        if message.kind == zenoh.SampleKind.DELETE:
            presence.set_token(name, False)
        elif presence.tokens < TOKENS_PER_TAG * site.quota.max_tags:
            presence.set_token(name, True)
            self._ingest.announce(key)
            self._catch_up.on_alive(key)
            self._caches.ask_if_silent(key)
