"""Publishes poses over Zenoh while somebody subscribes: each tag's pose on change, and one frame of all poses."""

import time
from types import TracebackType
from typing import Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_service.answers.answers import Answers, to_json
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.zenoh_io.periodic import PeriodicPublisher

PERIOD_S = 0.05  # the shortest time between two poses of a tag
FRAME_PERIOD_S = 0.1


class ZenohPoses(PeriodicPublisher):
    """Publishes while it is open.

    One publisher on `…/tag/*/pose` shows whether anybody subscribes to any tag. Each put then uses the key of its tag,
    and Zenoh drops those without a subscriber. One declared publisher per tag would stall the routing of a fleet.
    """

    def __init__(self, session: zenoh.Session, answers: Answers, metrics: Metrics) -> None:
        super().__init__("poses", PERIOD_S, metrics)
        self._session = session
        self._answers = answers
        self._site = answers.site.site.id
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
        return super().__enter__()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        super().__exit__(kind, error, traceback)
        self._tag_publisher.undeclare()
        self._frame_publisher.undeclare()

    def publish(self) -> None:
        """Put the poses of the tags that have changed, and the frame of all poses when it is due."""
        self._put_tags()
        self._put_frame()

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
