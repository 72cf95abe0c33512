"""Take in what tags report about themselves."""

from collections import Counter, deque
from collections.abc import Callable
from threading import Lock

import numpy as np

from dropanchor_schemas.keys import InvalidKeyError
from dropanchor_schemas.tag_health import HealthReport, decode_health
from dropanchor_schemas.wire import Reason, Rejection
from dropanchor_service.ingest.admission import Admission
from dropanchor_service.ingest.rejections import Rejections
from dropanchor_service.store import Sites, Tag

MAX_WAITING = 5_000
REPORTS_PER_TURN = 100  # about a millisecond of the ingest thread
REPORTS_PER_S = 5  # of one tag
_S = 1_000_000_000

Report = tuple[str, bytes, str, int]
"""Key, payload, encoding, UTC of arrival in ns."""


class HealthIntake:
    """Health from its arrival to the store. `put` may be called from any thread, `turn` only from the ingest thread.

    A tag that reports too often loses its own reports, not those of others.
    """

    def __init__(
        self, admission: Admission, sites: Sites, rejections: Rejections, wake: Callable[[], None] = lambda: None
    ) -> None:
        """wake: called after a report has come, for a turn."""
        self._wake = wake
        self._admission = admission
        self._sites = sites
        self._rejections = rejections
        self._lock = Lock()
        self._waiting: deque[Report] = deque()
        self._second = 0
        self._arrived: Counter[str] = Counter()  # by key, in this second
        self._surplus: Counter[str] = Counter()  # by key

    def put(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        """Take a report, to be used in the next turn."""
        with self._lock:
            if arrival_ns // _S != self._second:
                self._second = arrival_ns // _S
                self._arrived.clear()
            self._arrived[key] += 1
            if self._arrived[key] > REPORTS_PER_S or len(self._waiting) >= MAX_WAITING:
                self._surplus[key] += 1
            else:
                self._waiting.append((key, payload, encoding, arrival_ns))
        self._wake()

    def turn(self) -> None:
        """Use what has arrived."""
        if not self._waiting and not self._surplus:
            return
        with self._lock:
            reports = [self._waiting.popleft() for _ in range(min(len(self._waiting), REPORTS_PER_TURN))]
            surplus, self._surplus = self._surplus, Counter()
        for key, times in surplus.items():
            self._count(Reason.HEALTH_TOO_OFTEN, key, times)
        for report in reports:
            self._use(*report)

    def _use(self, key: str, payload: bytes, encoding: str, arrival_ns: int) -> None:
        decoded = decode_health(payload, encoding)
        if isinstance(decoded, Rejection):
            self._count(decoded.reason, key)
            return
        tag = self._admitted(key)
        if isinstance(tag, Reason):
            self._rejections.count_refused(tag, key)
            return
        self._store(tag, decoded, arrival_ns)

    def _store(self, tag: Tag, report: HealthReport, arrival_ns: int) -> None:
        self._rejections.count_rejected(Reason.HEALTH_ABSURD, np.full(len(report.absurd), tag.row))
        if report.values:
            self._sites[tag.site].health.record(tag.row, report.values, arrival_ns)

    def _admitted(self, key: str) -> Tag | Reason:
        try:
            return self._admission.admit(*self._sites.of_key(key))
        except InvalidKeyError:
            return Reason.KEY_INVALID

    def _count(self, reason: Reason, key: str, times: int = 1) -> None:
        """Count rejected reports, for their tag if it has a row."""
        try:
            tag = self._sites.tag_of(key)
        except InvalidKeyError:
            tag = None
        if tag is None:
            self._rejections.count_unregistered(reason, times)
        else:
            self._rejections.count_rejected(reason, np.full(times, tag.row))
