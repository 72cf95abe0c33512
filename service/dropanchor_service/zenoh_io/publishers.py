"""Poses put on Zenoh, per tag on change and as one frame of all, as long as somebody subscribes."""

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

PERIOD_S = 0.05  # a tag's pose is put at most so often
FRAME_PERIOD_S = 0.1


class ZenohPoses:
    """A thread of its own while it is open: putting may take time, and the ingest thread has none.

    One publisher on `…/tag/*/pose` tells whether anybody listens to any tag; the puts themselves name their tag, and
    Zenoh drops those that nobody has subscribed to. A declared publisher per tag would stall the routing of a fleet.
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
        self._of_tags = self._session.declare_publisher(
            keys.all_tags(self._site, "pose"), congestion_control=zenoh.CongestionControl.DROP
        )
        self._of_all = self._session.declare_publisher(
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
        self._of_tags.undeclare()
        self._of_all.undeclare()

    def _run(self) -> None:
        while not self._stop.wait(PERIOD_S):
            try:
                self._put_tags()
                self._put_frame()
            except Exception as error:
                self._metrics.faults.labels("publication").inc()
                self._log.exception("publication", error)

    def _put_tags(self) -> None:
        if not _is_wanted(self._of_tags):
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
        if time.monotonic() < self._frame_due_s or not _is_wanted(self._of_all):
            return
        if self._answers.latest.version == self._frame_version:
            return
        self._frame_due_s = time.monotonic() + FRAME_PERIOD_S
        self._frame_version, poses = self._answers.latest.since()
        self._of_all.put(to_json(self._answers.frame_of(poses, self._answers.now_ns())))


def _is_wanted(publisher: zenoh.Publisher) -> bool:
    """Whether anybody subscribes. The type stub says bool; what comes is an object that has one."""
    status = publisher.matching_status
    return bool(getattr(status, "matching", status))
