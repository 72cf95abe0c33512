"""Publishes poses over Zenoh while somebody subscribes: each tag's pose on change, and one frame of all poses."""

import logging
import threading
import time
from types import TracebackType
from typing import Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_service.answers.answers import Answers, to_json
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog

PERIOD_S = 0.05  # the shortest time between two poses of a tag
FRAME_PERIOD_S = 0.1


class ZenohPoses:
    """Publishes from its own thread while it is open, because a put may take longer than the ingest thread can wait.

    One publisher on `…/tag/*/pose` shows whether anybody subscribes to any tag. Each put then uses the key of its tag,
    and Zenoh drops those without a subscriber. One declared publisher per tag would stall the routing of a fleet.
    """

    def __init__(self, session: zenoh.Session, answers: Answers, metrics: Metrics) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._session = session
        self._answers = answers
        self._metrics = metrics
        self._site = answers.site.site.id
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="poses", daemon=True)
        self._tag_version = 0
        self._frame_version = 0
        self._frame_due_s = 0.0

    def __enter__(self) -> Self:
        self._tag_publisher = self._session.declare_publisher(
            keys.all_tags(self._site, "pose"), congestion_control=zenoh.CongestionControl.DROP
        )
        self._frame_publisher = self._session.declare_publisher(
            keys.poses_key(self._site),
            encoding=zenoh.Encoding.APPLICATION_JSON,
            congestion_control=zenoh.CongestionControl.DROP,
        )
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(1.0)
        self._tag_publisher.undeclare()
        self._frame_publisher.undeclare()

    def _run(self) -> None:
        while not self._stop.wait(PERIOD_S):
            try:
                self._put_tags()
                self._put_frame()
            except Exception as error:
                self._metrics.faults.labels("publication").inc()
                self._log.exception("publication", error)

    def _put_tags(self) -> None:
        if not _has_subscribers(self._tag_publisher):
            self._tag_version = self._answers.latest.version
            return
        self._tag_version, poses = self._answers.latest.since(self._tag_version)
        for tag, pose in self._answers.pose_jsons(poses, self._answers.now_ns()):
            self._session.put(
                keys.pose_key(self._site, tag),
                pose,
                encoding=zenoh.Encoding.APPLICATION_JSON,
                congestion_control=zenoh.CongestionControl.DROP,
            )

    def _put_frame(self) -> None:
        if time.monotonic() < self._frame_due_s or not _has_subscribers(self._frame_publisher):
            return
        if self._answers.latest.version == self._frame_version:
            return
        self._frame_due_s = time.monotonic() + FRAME_PERIOD_S
        self._frame_version, poses = self._answers.latest.since()
        self._frame_publisher.put(to_json(self._answers.frame_of(poses, self._answers.now_ns())))


def _has_subscribers(publisher: zenoh.Publisher) -> bool:
    """Return whether anybody subscribes. The type stub says bool, but Zenoh returns an object that holds one."""
    status = publisher.matching_status
    return bool(getattr(status, "matching", status))
