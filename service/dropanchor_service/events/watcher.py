"""Watch the poses of all sites, and turn what happens into events and states."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from dropanchor_service.answers.columns import aged_poses
from dropanchor_service.estimation.columns import Array
from dropanchor_service.events.site_watch import SiteWatch, WatchedSite
from dropanchor_service.store import LatestPoses
from dropanchor_service.store.starts import StartNews, StartPhase
from dropanchor_service.zones.modes import placed
from dropanchor_service.zones.zone_watch import ZoneWatch

SLOW_NS = 1_000_000_000  # between two looks at the rules for single tags
PAIRS_NS = 400_000_000  # and for pairs, which compare all tags
MAX_UNSAVED = 50_000  # events of a site that wait for the disk; then its tags are not judged until they are stored


class Watcher:
    """Follows the zones and rules of all sites. One thread owns it, and stores what `turn` adds to `sites`.

    A turn costs by what moves and what has changed, not by the number of sites. changed: the indices of the sites that
    have something to store, the longest waiting first.
    """

    def __init__(self, sites: Sequence[WatchedSite], latest: LatestPoses, now_ns: Callable[[], int]) -> None:
        """sites: in the order of their indices."""
        self._watched = sites
        self._rows = sites[0].tags.rows
        self._latest = latest
        self._now_ns = now_ns
        self._zones = ZoneWatch(len(sites) + 1)  # the last one stands for all that are no longer served
        self.changed: dict[int, None] = {}
        self.sites = [
            SiteWatch(site, self._zones, index, now_ns, partial(self.changed.setdefault, index, None))
            for index, site in enumerate(sites)
        ]
        self._edited = deque(range(len(sites)))
        for index, site in enumerate(sites):
            for told in (site.items.zones, site.items.rules, site.store):
                told.on_change.append(partial(self._edited.append, index))
        self._with_pairs: dict[int, SiteWatch] = {}
        self._with_tag_rules: dict[int, SiteWatch] = {}
        self._pose_version = 0
        self._slow_due_ns = self._pairs_due_ns = 0
        self._deleted: frozenset[int] = frozenset()
        self._follows_poses = True  # whether there is a zone or a rule for which poses matter
        self._unconfirmed: set[int] = set()  # rows whose start the ranges have not confirmed yet
        self._outdated: dict[int, int] = {}  # time of the latest pose of rows of which it comes from a start of before
        self.is_full = False
        """Whether there are more pairs of tags too close to each other than a rule can follow."""

    def on_news(self, told: Callable[[], None]) -> None:
        """Call this after each change that a turn would judge, on the thread that makes it.

        Poses are none while there is no zone and no rule.
        """
        self._latest.on_change.append(lambda: told() if self._follows_poses else None)
        self._rows.start_news.on_change.append(told)
        for site in self._watched:
            for one in (site.items.zones, site.items.rules, site.store):
                one.on_change.append(told)

    @property
    def needs_time(self) -> bool:
        """Whether time alone can make an event, or something waits to be stored: then turns must go on."""
        return bool(self._with_pairs or self._with_tag_rules or self.changed)

    def turn(self) -> None:
        """Judge what is new."""
        waiting = {index for index in self.changed if len(self.sites[index].happened) >= MAX_UNSAVED}
        if len(waiting) == len(self.sites):
            return
        self._follow_edits()
        news = self._rows.start_news.take()
        self._register_tags()
        for one in news:
            self._follow_start(one)
        self._follow_deletions()
        now_ns = self._now_ns()
        self._judge_zones(now_ns, waiting)
        if self._with_pairs and now_ns >= self._pairs_due_ns:
            self._pairs_due_ns = now_ns + PAIRS_NS
            self._judge_pairs(now_ns, waiting)
        if self._with_tag_rules and now_ns >= self._slow_due_ns:
            self._slow_due_ns = now_ns + SLOW_NS
            self._judge_tags(now_ns, waiting)

    def _follow_edits(self) -> None:
        for index in {self._edited.popleft() for _ in range(len(self._edited))}:
            site = self.sites[index]
            site.follow_edits()
            for sites, has_rules in ((self._with_pairs, site.has_pairs), (self._with_tag_rules, site.has_tag_rules)):
                if has_rules:
                    sites[index] = site
                else:
                    sites.pop(index, None)
        self._follows_poses = self._zones.has_zones or bool(self._with_pairs or self._with_tag_rules)

    def _register_tags(self) -> None:
        known = len(self._zones)
        if len(self._rows) <= known:
            return
        new = self._rows.all()[known:]
        nobody = len(self.sites)
        self._zones.add_tags([tag.name for tag in new], [min(tag.site, nobody) for tag in new])
        of_sites: dict[int, list[tuple[int, str]]] = {}
        for tag in new:
            of_sites.setdefault(tag.site, []).append((tag.row, tag.name))
        for index, tags in of_sites.items():
            if index < nobody:
                self.sites[index].add_tags(tags)

    def _follow_start(self, news: StartNews) -> None:
        """Judge a tag in zones and pairs from when the ranges have confirmed its start, or nobody follows it."""
        tag = self._rows.at(news.row)
        if tag.site >= len(self.sites):
            return
        site, pose = self.sites[tag.site], self._latest.row(news.row)
        site.follow_start(news, self._now_ns() if pose is None else int(pose["t_ns"]))
        told = news.phase == StartPhase.TOLD and news.place
        if told or (news.phase == StartPhase.RESUMED and site.has_start(tag.name)):
            self._unconfirmed.add(news.row)
        else:
            self._unconfirmed.discard(news.row)
        if pose is not None and not news.place and news.phase in (StartPhase.TOLD, StartPhase.DENIED):
            self._outdated[news.row] = int(pose["t_ns"])

    def _follow_deletions(self) -> None:
        deleted = self._rows.deleted
        if deleted is self._deleted:
            return
        for row in deleted - self._deleted:
            tag = self._rows.at(row)
            if tag.site < len(self.sites) and row < len(self._zones):
                self.sites[tag.site].forget_tag(tag.name)
        self._deleted = deleted

    def _known(self, poses: Array, waiting: set[int]) -> Array:
        """Return the POSE of registered tags, without those of sites that wait for the disk."""
        poses = poses[poses["row"] < len(self._zones)]
        return poses if not waiting else poses[~np.isin(self._rows.sites(poses["row"]), list(waiting))]

    def _confirmed(self, poses: Array) -> Array:
        """Return the POSE of tags whose place does not only come from what a person said."""
        if self._outdated:
            found = poses[np.isin(poses["row"], list(self._outdated))]
            for row, t_ns in zip(found["row"].tolist(), found["t_ns"].tolist(), strict=True):
                if t_ns != self._outdated[row]:
                    del self._outdated[row]
        left_out = self._unconfirmed | self._outdated.keys()
        return poses[~np.isin(poses["row"], list(left_out))] if left_out else poses

    def _judge_zones(self, now_ns: int, waiting: set[int]) -> None:
        self._pose_version, poses = self._latest.since(self._pose_version)
        poses = self._confirmed(self._known(poses, waiting))
        if not self._zones.has_zones or not len(poses):
            return
        for change in self._zones.judge(placed(poses, self._rows.overdue_s(poses, now_ns), self._latest)):
            self.sites[self._rows.at(change.row).site].note(change)

    def _judge_pairs(self, now_ns: int, waiting: set[int]) -> None:
        poses = self._confirmed(self._known(self._latest.since()[1], waiting))
        poses, modes = placed(poses, self._rows.overdue_s(poses, now_ns), self._latest).single()
        of_site = self._rows.sites(poses["row"])
        order = np.argsort(of_site, kind="stable")
        poses, modes, of_site = poses[order], modes[order], of_site[order]
        for index in self._with_pairs.keys() - waiting:
            begin, end = np.searchsorted(of_site, (index, index + 1))
            self._with_pairs[index].judge_pairs(poses[begin:end], modes[begin:end], now_ns)
        self.is_full = any(site.is_full for site in self._with_pairs.values())

    def _judge_tags(self, now_ns: int, waiting: set[int]) -> None:
        states = np.full(len(self._zones), -1, np.int64)
        poses = self._known(self._latest.since()[1], waiting)
        aged = aged_poses(poses, self._rows.overdue_s(poses, now_ns))
        states[aged["row"]] = aged["state"]
        for index in self._with_tag_rules.keys() - waiting:
            self._with_tag_rules[index].judge_tags(states, now_ns)
