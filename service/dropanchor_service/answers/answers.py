"""Turn rows of the store into the answers of the contract, for REST, the stream and Zenoh.

Answers are plain dictionaries and columns that `to_json` writes, because at ten thousand tags a model object per tag
would cost more than all the rest. Unknown floats are NaN in them, and null in JSON.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import orjson

from dropanchor_service.answers.care import wrong_clock
from dropanchor_service.answers.columns import aged_poses, columns_of, ellipse_95
from dropanchor_service.answers.findings import sentence_of
from dropanchor_service.answers.hints import SENDING_S, late
from dropanchor_service.answers.json_template import Filled
from dropanchor_service.answers.pose_at_time import BeforeMemoryError, pose_at
from dropanchor_service.answers.pose_fields import FRAME_FIELDS, POSE_FIELDS, ellipse_values
from dropanchor_service.answers.pose_filter import PoseFilter
from dropanchor_service.answers.pose_json import CHUNK, hypotheses_json, list_json, poses_json, relative_poses_json
from dropanchor_service.answers.track_pages import pose_in_tracks
from dropanchor_service.answers.unused import hints_about_unused
from dropanchor_service.estimation.columns import POSE, Array, State
from dropanchor_service.history.tracks import Tracks
from dropanchor_service.store.arrivals import LATE_S
from dropanchor_service.store.clock_offsets import ClockOffsets, NoClockOffsets
from dropanchor_service.store.health import HealthTable
from dropanchor_service.store.latest_poses import LatestPoses
from dropanchor_service.store.pending_tags import PendingTags
from dropanchor_service.store.site import SiteStore
from dropanchor_service.store.tags import Tag, TagTable
from dropanchor_service.store.unknown_anchors import FRESH_NS, hint_about
from dropanchor_service.store.wrong_times import hint_about_time

Answer = dict[str, Any]

EVERYTHING = PoseFilter()

_AMBIGUOUS = State.AMBIGUOUS.name.lower()


def to_json(answer: Any) -> bytes:
    """Return an answer as JSON: floats in the shortest form that reads back equal, NaN and infinity as null."""
    return orjson.dumps(answer, option=orjson.OPT_SERIALIZE_NUMPY)


class Answers:
    """The answers of the service, read from the store. Thread-safe."""

    def __init__(
        self,
        site: SiteStore,
        tags: TagTable,
        latest: LatestPoses,
        now_ns: Callable[[], int] = time.time_ns,
        tracks: Tracks | None = None,
        pending_tags: PendingTags | None = None,
        health: HealthTable | None = None,
        clock_offsets: ClockOffsets | None = None,
    ) -> None:
        """tracks: the history on disk, None if there is none. pending_tags: tags that have no row yet.
        health: what the tags report about themselves. clock_offsets: between the clocks of a tag."""
        self.site = site
        self.tags = tags
        self.latest = latest
        self.now_ns = now_ns
        self.tracks = tracks
        self.pending_tags = PendingTags(0) if pending_tags is None else pending_tags
        self.health = HealthTable() if health is None else health
        self.clock_offsets = NoClockOffsets() if clock_offsets is None else clock_offsets

    def unknown_anchor_of(self, tag: Tag) -> str | None:
        """Return the id of an anchor that the tag ranges to although the site lacks it, None if there is none."""
        unknown = self.tags.unknown_anchors.of(tag.row, self.now_ns())
        return unknown[1] if unknown is not None and self.site.lacks(unknown[0]) else None

    def hint_of(self, tag: Tag) -> str:
        """Return what a person can do so that more of the tag's samples are used; empty if there is nothing to do."""
        now_ns = self.now_ns()
        sent_ns = self.tags.rows.wrong_times.of(tag.row, now_ns)
        if sent_ns is not None:
            return hint_about_time(sent_ns)
        found = self.tags.rows.findings.of(tag.row)
        if found:
            return sentence_of(found[0])
        unknown = self.unknown_anchor_of(tag)
        if unknown is None:
            unused = hints_about_unused(np.array([tag.row]), self.tags, self.now_ns())
            return next((hint for hint, _ in unused), "") or self._hint_about_clock(tag, now_ns)
        range_ns = int(self.tags.arrivals.of(np.array([tag.row]))["range_ns"][0])
        return hint_about(unknown, hears_others=now_ns - range_ns <= FRESH_NS)

    def _hint_about_clock(self, tag: Tag, now_ns: int) -> str:
        """Return what to do about a clock that is off, or about samples that come late."""
        error_s = self.tags.rows.clock_errors.get(tag.row)
        if error_s is not None:
            return wrong_clock(error_s)
        arrival = self.tags.arrivals.of(np.array([tag.row]))[0]
        is_late = arrival["delay_s"] >= LATE_S and (now_ns - arrival["arrival_ns"]) * 1e-9 < SENDING_S
        return late(round(float(arrival["delay_s"]))) if is_late else ""

    def tags_in_group(self, group: str) -> list[str]:
        """Return the tags whose settings name this group."""
        names = [tag.name for tag in self.tags.listed()]
        return [name for name, is_in in zip(names, self.site.groups.are_in(names, [group]), strict=True) if is_in]

    def forget(self, tag: Tag) -> None:
        """Remove a tag from the answers until it sends again."""
        self.tags.delete(tag.row)
        self.tags.rows.norths.set(tag.row, None)
        self.latest.forget(tag.row)

    def pose_of(self, tag: Tag) -> Answer | None:
        """Return the `Pose` of a tag, None before its first one."""
        row = self.latest.row(tag.row)
        return None if row is None else self.poses_of(row[None], self.now_ns())[0]

    def pose_at(self, name: str, t_ns: int, from_disk: bool = True) -> Answer | None:
        """Return the `Pose` of a tag at a time, None if the tag never had one. Raises NoPoseThenError.

        from_disk: read the history on disk too, which takes a millisecond.
        """
        tracks = self.tracks if from_disk else None
        tag = self.tags.find(name)
        latest = None if tag is None else self.latest.row(tag.row)
        now_ns = self.now_ns()
        try:
            pose = None if latest is None else self._pose_in_memory(latest, t_ns, now_ns)
        except BeforeMemoryError:
            if tracks is None:
                raise
            pose = None
        if pose is None and tracks is not None:
            memory = np.empty(0, POSE) if tag is None or latest is None else self._memory(latest)
            pose = pose_in_tracks(tracks, self.site, name, memory, t_ns)
        if pose is None:
            return None
        return self._poses(pose[None], now_ns, historical=True, names=[name])[0] | {"hypotheses": []}

    def _pose_in_memory(self, latest: Array, t_ns: int, now_ns: int) -> Array:
        aged = aged_poses(latest[None], self.tags.rows.overdue_s(latest[None], now_ns))[0]
        return pose_at(self.latest.history(int(latest["row"])), latest if t_ns <= latest["t_ns"] else aged, t_ns)

    def _memory(self, latest: Array) -> Array:
        return np.append(self.latest.history(int(latest["row"])), latest)

    def pose_list(self, tags: Sequence[Tag] | None = None, wanted: PoseFilter = EVERYTHING) -> Answer:
        """Return the `PoseList` of the wanted poses of these tags, or of all tags. Tags without a pose are left out."""
        now_ns = self.now_ns()
        return {"t_ns": now_ns, "poses": self.poses_of(self._wanted(tags, wanted, now_ns), now_ns)}

    def pose_list_json(
        self, tags: Sequence[Tag] | None = None, wanted: PoseFilter = EVERYTHING
    ) -> Iterator[bytes | memoryview]:
        """Yield the JSON of `pose_list` in chunks, without an object per tag."""
        now_ns = self.now_ns()
        return list_json(now_ns, (filled for _, filled in self._filled(self._wanted(tags, wanted, now_ns), now_ns)))

    def _wanted(self, tags: Sequence[Tag] | None, wanted: PoseFilter, now_ns: int) -> Array:
        poses = self.rows(tags)
        return poses if wanted.is_everything else poses[wanted.matches(poses, self.tags, self.site, now_ns)]

    def pose_jsons(self, poses: Array, now_ns: int) -> Iterator[tuple[str, bytes]]:
        """Yield the tag and the JSON of its `Pose` for each of these POSE rows, which are the latest."""
        for names, filled in self._filled(poses, now_ns):
            yield from zip(names, filled.each, strict=True)

    def _filled(self, poses: Array, now_ns: int) -> Iterator[tuple[list[str], Filled]]:
        """Yield the tags and the JSON of their poses, in chunks."""
        for begin in range(0, len(poses), CHUNK):
            columns = columns_of(poses[begin : begin + CHUNK], self.site, self.tags, now_ns)
            yield columns.tags, poses_json(columns, self._hypotheses_json(columns.poses))

    def _hypotheses_json(self, poses: Array) -> list[bytes]:
        """Return the JSON of the hypotheses of each POSE row that is ambiguous."""
        rows = poses["row"][poses["state"] == State.AMBIGUOUS]
        return hypotheses_json(*self.latest.hypotheses_of(rows)) if len(rows) else []

    def poses_of(self, poses: Array, now_ns: int) -> list[Answer]:
        """Return the `Pose` for each of these POSE rows, which are the latest."""
        answers = self._poses(poses, now_ns)
        for answer, row in zip(answers, poses["row"].tolist(), strict=True):
            hypotheses = self._hypotheses_of(row, answer["state"]) or []
            answer["hypotheses"] = [] if answer["relative_pose"] else hypotheses
            if answer["relative_pose"]:
                answer["relative_pose"]["hypotheses"] = hypotheses
        return answers

    def _poses(
        self, poses: Array, now_ns: int, historical: bool = False, names: Sequence[str] | None = None
    ) -> list[Answer]:
        """Return the `Pose` for each of these POSE rows, without hypotheses."""
        columns = columns_of(poses, self.site, self.tags, now_ns, historical, names)
        every = zip(*(field.values(columns) for field in POSE_FIELDS.values()), strict=True)
        return [dict(zip(POSE_FIELDS, values, strict=True)) for values in every]

    def frame_of(self, poses: Array, now_ns: int) -> Answer:
        """Return the `PoseFrame` of these POSE rows: columns, cheap for many tags many times a second."""
        columns = columns_of(poses, self.site, self.tags, now_ns)
        values = {name: field.frame_values(columns) for name, field in FRAME_FIELDS.items()}
        frame = {"t_ns": now_ns, "epoch": columns.epoch} | {
            name: column for name, column in values.items() if column is not None
        }
        ambiguous = columns.poses["state"] == State.AMBIGUOUS
        modes = dict(zip(np.flatnonzero(ambiguous).tolist(), self._hypotheses_json(columns.poses), strict=True))
        if columns.own is not None:
            own = np.flatnonzero(ambiguous & columns.own.is_known).tolist()
            frame["relative_pose"] = relative_poses_json(columns.own, [modes.pop(place) for place in own])
        frame["hypotheses"] = [orjson.Fragment(modes[i]) if i in modes else None for i in range(len(ambiguous))]
        return frame

    def rows(self, tags: Sequence[Tag] | None = None) -> Array:
        """Return the latest POSE rows of these tags, or of all tags. Tags without a pose are left out."""
        if tags is None and self.tags.has_every_row:
            return self.latest.since()[1]
        return self.latest.of(np.array([tag.row for tag in (self.tags.all() if tags is None else tags)], np.int64))

    def _hypotheses_of(self, row: int, state: str) -> list[Answer] | None:
        """Return the hypotheses of an ambiguous tag, None for another."""
        return _hypotheses(self.latest.hypotheses(row)) if state == _AMBIGUOUS else None


def _hypotheses(modes: Array) -> list[Answer]:
    """Return a `Hypothesis` for each HYPOTHESIS."""
    fields = zip(*(modes[name].tolist() for name in ("weight", "x", "y", "heading", "speed")), strict=True)
    return [
        {"weight": weight, "x": x, "y": y, "heading_rad": heading, "speed_mps": speed, "ellipse_95": ellipse}
        for (weight, x, y, heading, speed), ellipse in zip(
            fields, ellipse_values(*ellipse_95(modes["cov"])), strict=True
        )
    ]
