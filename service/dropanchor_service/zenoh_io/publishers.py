"""Publishes poses over Zenoh while somebody subscribes: each tag's pose on change, and one frame of a site's poses."""

import time
from typing import Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.of_sites import AnswersOfSites
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.zenoh_io.periodic import PeriodicPublisher

PERIOD_S = 0.05  # the shortest time between two poses of a tag
FRAME_PERIOD_S = 0.1


class ZenohPoses(PeriodicPublisher):
    """Publishes while it is open.

    One publisher on `…/tag/*/pose` shows whether anybody subscribes to any tag. Each put then uses the key of its tag,
    and Zenoh drops those without a subscriber. One declared publisher per tag would stall the routing of a fleet.

    With several sites, that publisher is for all of them. When somebody subscribes, each site gets publishers of its
    own, which show whether anybody wants its poses.
    """

    def __init__(
        self, session: zenoh.Session, sites: AnswersOfSites, metrics: Metrics, may_publish: MayServe = always
    ) -> None:
        super().__init__("poses", PERIOD_S, metrics, may_publish)
        self._session = session
        self._sites = sites
        self._of_site: dict[str, zenoh.Publisher] = {}  # by key expression
        self._tag_version = 0
        self._frame_version = 0
        self._frame_due_s = 0.0
        self._is_matched = False
        sites.latest.on_change.append(self._on_change)

    def __enter__(self) -> Self:
        tags, frames = self._keys()
        self._tag_publisher = self._session.declare_publisher(tags)
        self._frame_publisher = self._session.declare_publisher(frames)
        # The first subscriber gets a frame of what there is.
        self._listeners = [
            publisher.declare_matching_listener(zenoh.handlers.Callback(self._on_matching, indirect=False))
            for publisher in (self._tag_publisher, self._frame_publisher)
        ]
        self.wake()
        return super().__enter__()

    def _on_change(self) -> None:
        if self._is_matched:
            self.wake()

    def _on_matching(self, _: zenoh.MatchingStatus) -> None:
        if not self._is_matched:
            self._tag_version, self._is_matched = self._sites.latest.version, True
        self.wake()

    def __exit__(self, *raised: object) -> None:
        super().__exit__(*raised)
        for listener in self._listeners:
            listener.undeclare()
        for publisher in (self._tag_publisher, self._frame_publisher, *self._of_site.values()):
            publisher.undeclare()

    def _keys(self) -> tuple[str, str]:
        """Return the key expressions of the poses of tags and of frames."""
        if self._sites.only is None:
            return keys.all_sites("pose", self._sites.bucket), keys.poses_of_all_sites(self._sites.bucket)
        site = self._sites.only.site.site.id
        return keys.all_tags(site, "pose"), keys.poses_key(site)

    def publish(self) -> None:
        """Put the poses of the tags that have changed, and the frame of all poses when it is due."""
        self._is_matched = _has_subscribers(self._tag_publisher) or _has_subscribers(self._frame_publisher)
        self._put_tags()
        self._put_frame()

    def _put_tags(self) -> None:
        if self._sites.latest.version == self._tag_version:
            return
        if not _has_subscribers(self._tag_publisher):
            self._tag_version = self._sites.latest.version
            return
        self._tag_version, poses = self._sites.latest.since(self._tag_version)
        for answers, of_site in self._sites.divided(poses):
            site = answers.site.site.id
            if self._is_wanted(keys.all_tags(site, "pose")):
                for tag, pose in answers.pose_jsons(of_site, answers.now_ns()):
                    self._put(keys.pose_key(site, tag), pose)

    def _put_frame(self) -> None:
        if self._sites.latest.version == self._frame_version or not _has_subscribers(self._frame_publisher):
            return
        if time.monotonic() < self._frame_due_s:
            self.wake()
            return
        self._frame_due_s = time.monotonic() + FRAME_PERIOD_S
        self._frame_version, changed = self._sites.latest.since(self._frame_version)
        for answers, _ in self._sites.divided(changed):
            key = keys.poses_key(answers.site.site.id)
            if self._is_wanted(key):
                self._put(key, to_json(answers.frame_of(answers.rows(), answers.now_ns())))

    def _is_wanted(self, key_expr: str) -> bool:
        """Return whether anybody subscribes to these keys of one site. With an only site, that is known already."""
        if self._sites.only is not None:
            return True
        if key_expr not in self._of_site:
            self._of_site[key_expr] = self._session.declare_publisher(key_expr)
        return _has_subscribers(self._of_site[key_expr])

    def _put(self, key: str, answer: bytes) -> None:
        self._session.put(
            key,
            answer,
            encoding=zenoh.Encoding.APPLICATION_JSON,
            congestion_control=zenoh.CongestionControl.DROP,
        )


def _has_subscribers(publisher: zenoh.Publisher) -> bool:
    """Return whether anybody subscribes. The type stub says bool, but Zenoh returns an object that holds one."""
    status = publisher.matching_status
    return bool(getattr(status, "matching", status))
