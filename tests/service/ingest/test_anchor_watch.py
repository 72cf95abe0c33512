"""Anchors that somebody moved without telling are doubted, from what the ranges of all their tags say."""

from collections.abc import Sequence

import numpy as np
import pytest

from dropanchor_schemas.site import Anchor
from dropanchor_schemas.wire import Frame
from dropanchor_service.answers.hints import hints_of
from dropanchor_service.estimation.columns import INNOVATION, POSE, Array, PoseBatch, State, StateReason
from dropanchor_service.ingest.anchor_watch import AnchorWatch
from dropanchor_service.store.anchor_doubts import AnchorDoubt, AnchorDoubts
from service.ingest.messages import ranges
from support.ingest import IngestBench, TransparentEngine

SECOND = 1_000_000_000
T0 = 1_790_000_000 * SECOND
MOVED_NS = T0 + 10 * SECOND
Step = tuple[float, float]
"""m, and s by which it is later than the first."""
Offs = tuple[float, float]
"""m, to one anchor and to another."""


def innovations(row: int, step: Step, anchor: int = 0, end_s: float = 15.0) -> Array:
    """Return 10 Hz of ranges to an anchor that change by a step after 10 s, or by 0 m: not."""
    way, late_s = step
    t_ns = T0 + np.arange(0, int(end_s * SECOND), SECOND // 10)
    after = (t_ns >= MOVED_NS + int(late_s * SECOND)) & (way != 0.0)
    found = np.zeros(len(t_ns), INNOVATION)
    found["row"], found["t_ns"], found["anchor"], found["S"] = row, t_ns, anchor, 0.01
    found["innovation"], found["p_outlier"] = np.where(after, way, 0.0), np.where(after, 0.9, 0.0)
    return found


def poses_at_end(rows: Sequence[int]) -> Array:
    poses = np.zeros(len(rows), POSE)
    poses["row"], poses["t_ns"], poses["state"], poses["reason"] = rows, T0 + 15 * SECOND, State.TRACKING, 4
    return poses


def watched(parts: Sequence[Array], rows: int) -> tuple[AnchorWatch, AnchorDoubts, PoseBatch]:
    """Return a watch after these innovations in order of time, and the last poses of the rows."""
    doubts = AnchorDoubts()
    watch = AnchorWatch(doubts, lambda index: f"anchor-{index}")
    for row in range(rows):
        watch.begin(row)
    all_of_them = np.concatenate(parts)
    all_of_them = all_of_them[np.argsort(all_of_them["t_ns"], kind="stable")]
    for first in range(0, len(all_of_them), 7):
        watch.look(PoseBatch(innovations=all_of_them[first : first + 7]))
    batch = PoseBatch(poses=poses_at_end(range(rows)))
    watch.look(batch)
    return watch, doubts, batch


@pytest.mark.parametrize(
    ("steps", "doubted"),
    [
        ([(-2.0, 0.0), (2.5, 0.0)], True),
        ([(-2.0, 0.0), (2.5, 0.2), (0.0, 0.0), (0.0, 0.0)], True),
        ([(-2.0, 0.0), (0.0, 0.0), (0.0, 0.0)], False),  # that is the matter of one tag
        ([(-2.0, 0.0), (2.5, 3.0)], False),  # one after the other
        ([(2.0, 0.0), (2.5, 0.0)], False),  # something stands before the anchor
        ([(2.0, 0.0), (2.5, 0.0), (2.0, 0.0), (0.0, 0.0)], True),
        ([(2.0, 0.0), (2.5, 0.0), (2.0, 0.0), *[(0.0, 0.0)] * 4], False),
        ([(-2.0, 0.0)], True),  # nothing makes the ranges of a tag shorter all at once
        ([(2.0, 0.0)], False),
        ([(-0.3, 0.0), (0.4, 0.0)], False),
        ([(0.0, 0.0), (0.0, 0.0)], False),
    ],
)
def test_an_anchor_is_doubted_when_the_ranges_of_its_tags_change_together(steps: list[Step], doubted: bool) -> None:
    _, doubts, batch = watched([innovations(row, step) for row, step in enumerate(steps)], len(steps))
    assert set(batch.poses["state"].tolist()) == {State.AMBIGUOUS if doubted else State.TRACKING}
    assert (batch.poses["reason"] == StateReason.ANCHOR_DOUBTED).all() == doubted
    found = doubts.of(0)
    assert (found is not None) == doubted
    if found is not None:
        assert (found.anchor, found.since_ns) == ("anchor-0", MOVED_NS)
        assert found.way_m == pytest.approx(max(abs(way) for way, _ in steps))


def test_tags_of_other_anchors_are_believed_and_all_again_once_somebody_says_where_the_anchor_is() -> None:
    parts = [innovations(0, (-2.0, 0.0)), innovations(1, (2.0, 0.0)), innovations(2, (0.0, 0.0), anchor=1)]
    watch, doubts, batch = watched(parts, 3)
    assert (batch.poses["state"] == State.AMBIGUOUS).tolist() == [True, True, False]
    watch.told([0])
    batch = PoseBatch(poses=poses_at_end([0, 1, 2]))
    watch.look(batch)
    assert (batch.poses["state"] == State.TRACKING).all()
    assert doubts.of(0) is None


def test_tracks_that_contradict_the_ranges_since_somebody_said_where_the_anchor_is_doubt_nothing() -> None:
    later = [innovations(row, (way, 1.0)) for row, way in ((2, -2.0), (3, 2.0))]
    told_ns = MOVED_NS + SECOND // 2
    at_once = [innovations(0, (-2.0, 0.0)), innovations(1, (2.0, 0.0))]
    watch, doubts, _ = watched([part[part["t_ns"] < told_ns] for part in (*at_once, *later)], 4)
    assert doubts.of(0) is not None
    watch.told([0])
    watch.look(PoseBatch(innovations=np.concatenate([part[part["t_ns"] >= told_ns] for part in later])))
    watch.look(PoseBatch(poses=poses_at_end(range(4))))
    assert doubts.of(0) is None


def test_a_tag_that_hears_another_anchor_too_says_nothing_alone() -> None:
    _, doubts, batch = watched([innovations(0, (-2.0, 0.0)), innovations(0, (0.0, 0.0), anchor=1)], 1)
    assert doubts.of(0) is None
    assert (batch.poses["state"] == State.TRACKING).all()


def test_a_tag_whose_ranges_never_agreed_doubts_nothing() -> None:
    noisy = [innovations(row, (way, -8.0)) for row, way in enumerate((-2.0, 2.0))]
    _, doubts, _ = watched(noisy, 2)
    assert doubts.of(0) is None


def met(row: int, offs: Offs, state: State) -> PoseBatch:
    """Return the first range of a tag to each of two anchors, and how far it contradicts the track."""
    found, poses = np.zeros(2, INNOVATION), np.zeros(2, POSE)
    for column in (found, poses):
        column["row"], column["t_ns"], column["anchor"] = row, T0 + np.arange(2), [0, 1]
    found["innovation"], found["S"], poses["state"] = offs, 0.1, state
    return PoseBatch(poses=poses, innovations=found)


@pytest.mark.parametrize(
    ("tags", "state", "doubted"),
    [
        ([(0.0, -3.0), (0.0, 2.0)], State.TRACKING, "1"),
        ([(-3.0, 0.0), (-3.0, 0.0), (0.0, 0.0)], State.TRACKING, "0"),
        ([(0.0, 3.0)] * 3, State.TRACKING, "1"),
        ([(0.0, 3.0)] * 2, State.TRACKING, None),  # something stands before the anchor
        ([(0.0, -3.0)], State.TRACKING, None),  # that is the matter of one tag
        ([(-3.0, -3.0)] * 4, State.TRACKING, None),  # all ranges are too short, or the start is wrong
        ([(0.0, -0.9)] * 4, State.TRACKING, None),  # less than three deviations
        ([(0.0, 0.0)] * 5 + [(0.0, -3.0)] * 2, State.TRACKING, None),
        ([(0.0, -3.0)] * 4, State.AMBIGUOUS, None),  # the tags may be elsewhere
    ],
)
def test_an_anchor_is_doubted_that_tags_meet_elsewhere_than_their_tracks_say(
    tags: list[Offs], state: State, doubted: str | None
) -> None:
    doubts = AnchorDoubts()
    watch = AnchorWatch(doubts, str)
    for row, offs in enumerate(tags):
        watch.begin(row)
        watch.look(met(row, offs, state))
    watch.look(PoseBatch(poses=poses_at_end([0])))
    found = doubts.of(0)
    assert (found and (found.anchor, found.since_ns)) == (doubted and (doubted, 0))
    watch.told([0, 1])
    watch.look(met(0, tags[0], state))  # no longer a first range
    watch.look(PoseBatch(poses=poses_at_end([0])))
    assert doubts.of(0) is None


class Contradicting(TransparentEngine):
    """An engine whose track denies every range that is longer than 40 m or shorter than 20 m."""

    def process(self, samples: object) -> PoseBatch:
        batch = super().process(samples)  # type: ignore[arg-type]
        found = np.zeros(len(batch.poses), INNOVATION)
        for name in ("row", "t_ns", "anchor"):
            found[name] = batch.poses[name]
        found["innovation"], found["S"] = batch.poses["range"] - 30.0, 0.01
        found["p_outlier"] = np.abs(found["innovation"]) > 10.0
        batch.poses["reason"] = StateReason.RESOLVED
        return PoseBatch(poses=batch.poses, innovations=found)


def sent(bench: IngestBench, tag: str, range_m: float, first_s: int, last_s: int) -> None:
    t0_ns = bench.clock.now_ns() - 60 * SECOND
    one = ranges(range_m).ranges[0]
    times = range(first_s * 10, last_s * 10)
    bench.send(tag, Frame(ranges=[one._replace(t_ns=t0_ns + k * SECOND // 10) for k in times]))


def test_the_hint_names_the_anchor_and_saving_it_again_confirms_its_place() -> None:
    bench = IngestBench(engine=Contradicting())
    for tag in "ab":
        sent(bench, tag, 30.0, 0, 10)
    for tag, later in (("a", 18.0), ("b", 42.0)):
        sent(bench, tag, later, 10, 12)
    sent(bench, "a", 18.0, 12, 13)
    pose = bench.latest.row(0)
    assert pose is not None
    assert [int(pose["state"]), int(pose["reason"])] == [State.AMBIGUOUS, StateReason.ANCHOR_DOUBTED]
    texts, hint = hints_of(np.array([pose], POSE), bench.site, bench.tags, bench.clock.now_ns())
    assert texts[hint[0]].startswith("Anchor 7 seems to have moved by 12.0 m or more at ")
    bench.site.set_anchor(Anchor(id="7"))
    sent(bench, "a", 30.0, 13, 14)
    assert bench.latest.row(0)["state"] == State.TRACKING  # type: ignore[index]
    bench.tags.rows.anchor_doubts.set(0, AnchorDoubt("7", 3.0, 0))
    texts, hint = hints_of(np.array([pose], POSE), bench.site, bench.tags, bench.clock.now_ns())
    assert texts[hint[0]].startswith("Anchor 7, or another one that its tags hear, seems to stand about 3.0 m from ")
