"""The answers of the service, from the rows of the store."""

import json
import math
from typing import Any

import numpy as np
import pytest

from dropanchor_schemas.pose import Pose, PoseList
from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.answers.answers import Answers, to_json
from dropanchor_service.answers.columns import REASONS, ellipse_95
from dropanchor_service.answers.hints import RELATIVE_HINT
from dropanchor_service.answers.reason_hints import HINTS
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, Array, Frame, State, StateReason
from dropanchor_service.store import LatestPoses, SiteStore, TagTable

T_NS = 1_800_000_000_000_000_000
NO_MODES = np.empty(0, HYPOTHESIS)


def make_pose(row: int = 0, **fields: Any) -> Array:
    pose = np.zeros(1, POSE)
    pose["row"], pose["t_ns"], pose["state"], pose["reason"] = row, T_NS, State.TRACKING, StateReason.RESOLVED
    pose["cov"] = np.diag([0.04, 0.01, 0.001])
    pose["x"], pose["y"], pose["p_mode"] = 3.0, 4.0, 1.0
    for name, value in fields.items():
        pose[name] = value
    return pose


def make_answers(site: Site | None = None, age_s: float = 0.25) -> Answers:
    store = SiteStore(site or Site(anchors=[Anchor(id="17")]), {})
    return Answers(store, TagTable(), LatestPoses(), now_ns=lambda: T_NS + round(age_s * 1e9))


def pose_of(answers: Answers, name: str = "a") -> Any:
    return json.loads(to_json(answers.pose_of(answers.tags.register(name))))


def test_a_tag_without_a_pose_has_no_answer() -> None:
    answers = make_answers()
    assert answers.pose_of(answers.tags.register("a")) is None
    assert answers.pose_list()["poses"] == []


def test_an_answer_is_a_pose_of_the_contract() -> None:
    answers = make_answers()
    answers.tags.register("a")
    answers.tags.presence.set_token("a", True)
    answers.latest.write(make_pose(x=1.5, y=-2.5, heading=0.1, speed=1.2, range=2.9, sigma_pos=0.2), NO_MODES)
    pose = Pose.model_validate(pose_of(answers))
    assert (pose.tag, pose.t_ns, pose.age_s, pose.online, pose.anchor) == ("a", T_NS, 0.25, True, "17")
    assert (pose.x, pose.y, pose.heading_rad, pose.speed_mps, pose.range_m) == (1.5, -2.5, 0.1, 1.2, 2.9)
    assert (pose.state, pose.reason, pose.hint) == ("tracking", "resolved", "")
    assert pose.covariance == [[0.04, 0, 0], [0, 0.01, 0], [0, 0, 0.001]]


def test_unknown_values_are_null() -> None:
    answers = make_answers()
    answers.tags.register("a")
    unknown: dict[str, Any] = dict.fromkeys(
        ("x", "y", "heading", "speed", "yaw_rate", "range", "sigma_pos", "sigma_obs"), np.nan
    )
    answers.latest.write(make_pose(**unknown, cov=np.inf, anchor=-1), NO_MODES)
    pose = pose_of(answers)
    nulls = {name for name, value in pose.items() if value is None}
    assert nulls >= {"x", "y", "heading_rad", "covariance", "ellipse_95", "range_m", "anchor", "lat", "lon"}
    Pose.model_validate(pose)


def test_numbers_read_back_bit_for_bit() -> None:
    answers = make_answers()
    answers.tags.register("a")
    answers.latest.write(make_pose(x=math.pi, y=1e-17, cov=np.eye(3) / 3), NO_MODES)
    pose = pose_of(answers)
    assert (pose["x"], pose["y"], pose["covariance"][0][0], pose["t_ns"]) == (math.pi, 1e-17, 1 / 3, T_NS)


@pytest.mark.parametrize(
    ("age_s", "state", "reason"),
    [(0.9, "tracking", "resolved"), (1.1, "coasting", "ranges_missing"), (10.1, "lost", "ranges_missing")],
)
def test_an_old_pose_does_not_look_like_a_good_one(age_s: float, state: str, reason: str) -> None:
    answers = make_answers(age_s=age_s)
    answers.tags.register("a")
    answers.latest.write(make_pose(), NO_MODES)
    pose = pose_of(answers)
    assert (pose["state"], pose["reason"]) == (state, reason)
    frame = answers.frame_of(answers.rows(), answers.now_ns())
    assert (frame["state"], frame["reason"]) == ([state], [reason])


def test_the_pose_of_an_ambiguous_tag_has_its_hypotheses() -> None:
    answers = make_answers()
    answers.tags.register("a")
    modes = np.zeros(2, HYPOTHESIS)
    modes["weight"], modes["x"], modes["cov"] = [0.7, 0.3], [1.0, -1.0], np.eye(2) * 0.01
    answers.latest.write(make_pose(state=State.AMBIGUOUS, reason=StateReason.SEVERAL_MODES), modes)
    pose = Pose.model_validate(pose_of(answers))
    assert [(mode.weight, mode.x) for mode in pose.hypotheses] == [(0.7, 1.0), (0.3, -1.0)]
    assert pose.hypotheses[0].ellipse_95 is not None
    assert pose.hint


def test_every_reason_but_a_good_one_has_a_hint() -> None:
    assert {reason for reason, hint in zip(REASONS, HINTS, strict=True) if not hint} == {"resolved"}


def test_the_ellipse_follows_from_the_eigenvectors() -> None:
    rng = np.random.default_rng(7)
    roots = rng.normal(size=(200, 2, 2))
    cov = roots @ roots.swapaxes(1, 2)
    major, minor, angle = ellipse_95(cov)
    values, vectors = np.linalg.eigh(cov)
    assert np.allclose(np.stack([minor, major], 1), np.sqrt(-2 * np.log(0.05) * values))
    across = np.abs(np.cos(angle) * vectors[:, 1, 1] - np.sin(angle) * vectors[:, 0, 1])
    assert across.max() < 1e-6


def test_a_list_holds_all_tags_with_a_pose_or_the_chosen_ones() -> None:
    answers = make_answers()
    tags = [answers.tags.register(name) for name in "abc"]
    answers.latest.write(np.concatenate([make_pose(0), make_pose(2, x=7.0)]), NO_MODES)
    everyone = PoseList.model_validate_json(to_json(answers.pose_list()))
    assert [pose.tag for pose in everyone.poses] == ["a", "c"]
    assert [pose["tag"] for pose in answers.pose_list(tags[1:])["poses"]] == ["c"]
    assert answers.pose_list([])["poses"] == []


def test_a_pose_without_north_says_so_and_has_no_place_on_earth() -> None:
    answers = make_answers(Site(georeference=Georeference(lat=50, lon=8)))
    for name in "ab":
        answers.tags.register(name)
    answers.latest.write(np.concatenate([make_pose(0, frame=Frame.RELATIVE), make_pose(1)]), NO_MODES)
    relative, placed = PoseList.model_validate_json(to_json(answers.pose_list())).poses
    assert (relative.frame, placed.frame) == ("relative", "site")
    assert (relative.hint, placed.hint) == (RELATIVE_HINT, "")
    assert (relative.state, placed.state) == ("relative", "tracking")
    assert (relative.x, relative.y, relative.lat, relative.lon) == (None, None, None, None)
    assert relative.relative_pose is not None
    assert (relative.relative_pose.x, placed.relative_pose) == (3.0, None)
    assert placed.lat is not None


def test_a_frame_has_one_entry_per_tag_in_every_column() -> None:
    answers = make_answers(Site(georeference=Georeference(lat=50, lon=8)))
    for name in "abc":
        answers.tags.register(name)
    answers.latest.write(np.concatenate([make_pose(row, x=np.nan) for row in range(3)]), NO_MODES)
    frame = json.loads(to_json(answers.frame_of(answers.rows(), answers.now_ns())))
    assert frame.pop("t_ns") == answers.now_ns()
    assert frame.pop("epoch") == 0
    assert {len(column) for column in frame.values()} == {3}
    assert frame["x"] == frame["lat"] == [None] * 3
