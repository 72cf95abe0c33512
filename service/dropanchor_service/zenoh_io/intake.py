"""What comes in over Zenoh: samples and liveliness. Callbacks put things down and return; they never call Zenoh.

Samples have no callback: a receive thread that had to win the interpreter for each of them would wait up to 5 ms each
time another thread computes, and what is live would pile up in the router and be dropped there.
"""

import logging
import threading
from types import TracebackType
from typing import Any, Self

import zenoh
import zenoh.ext

from dropanchor_schemas import keys
from dropanchor_schemas.wire import payload_encoding
from dropanchor_service.ingest.catch_up import CatchUp
from dropanchor_service.ingest.turn import Ingest
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.clock import UtcClock
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store import TagTable
from dropanchor_service.zenoh_io.caches import ZenohCaches
from dropanchor_service.zenoh_io.channel import received

WAITING = 2**14  # messages between the receive thread and ours
GATHER_S = 0.005  # of messages that are taken together


class ZenohIntake:
    """Subscribed while it is open. Messages that a tag's publisher still has are asked for when they were missed."""

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        ingest: Ingest,
        catch_up: CatchUp,
        caches: ZenohCaches,
        tags: TagTable,
        metrics: Metrics,
        clock: UtcClock,
        max_tags: int,
    ) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._session = session
        self._site = site
        self._ingest = ingest
        self._tags = tags
        self._metrics = metrics
        self._clock = clock
        self._max_tokens = 2 * max_tags
        self._catch_up = catch_up
        self._caches = caches
        self._declared: list[Any] = []

    def __enter__(self) -> Self:
        samples = zenoh.ext.declare_advanced_subscriber(
            self._session,
            keys.all_tags(self._site, "samples"),
            zenoh.handlers.FifoChannel(WAITING),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
        misses = samples.sample_miss_listener(zenoh.handlers.Callback(self._on_miss, indirect=False))
        tokens = self._session.liveliness().declare_subscriber(
            keys.all_tags(self._site, "alive"),
            zenoh.handlers.Callback(self._on_token, indirect=False),
            history=True,
        )
        self._declared = [misses, samples, tokens]
        self._thread = threading.Thread(target=self._take_all, args=(samples.handler,), name="samples", daemon=True)
        self._thread.start()
        self._caches.start(self._catch_up)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._caches.stop()
        for declared in self._declared:
            declared.undeclare()
        self._thread.join(1.0)

    def _take_all(self, samples: Any) -> None:
        """Until the subscriber is undeclared."""
        for message in received(samples, GATHER_S):
            self._hear(message)

    def _hear(self, message: zenoh.Sample) -> None:
        now_ns = self._clock.now_ns()
        encoding = payload_encoding(str(message.encoding))
        self._catch_up.on_live(str(message.key_expr), bytes(message.payload), encoding, now_ns)

    def _on_miss(self, miss: zenoh.ext.Miss) -> None:
        self._metrics.misses.inc(miss.nb)
        self._log.warning("messages are lost for good", f"{miss.nb} of one publisher, which no longer has them")

    def _on_token(self, message: zenoh.Sample) -> None:
        try:
            name = keys.tag_from_key(str(message.key_expr))
        except keys.InvalidKeyError:
            return
        if message.kind == zenoh.SampleKind.DELETE:
            self._tags.set_online(name, False)
        elif self._tags.online_names < self._max_tokens:
            self._tags.set_online(name, True)
            self._ingest.announce(name)
            self._catch_up.on_alive(keys.samples_key(self._site, name))
