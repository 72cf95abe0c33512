"""Poses written from columns equal those written one by one, except for digits beyond the accuracy."""

import json
import math
from typing import Any

import numpy as np
import orjson
import pytest

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.answers.answers import Answers, to_json
from dropanchor_service.answers.json_template import NUMBER, filled
from dropanchor_service.answers.pose_fields import DECIMALS, FINE_DECIMALS
from dropanchor_service.answers.pose_json import CHUNK
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, Frame, State, StateReason
from dropanchor_service.store import LatestPoses, SiteStore, TagTable

T_NS = 1_800_000_000_000_000_000
NAMES = ["plain", 'a","b', "back\\", '\\"', "ü/ß", ",", "]],[[", "null"]


def answers_with(count: int, site: Site) -> Answers:
    answers = Answers(SiteStore(site, {}), TagTable(), LatestPoses(), now_ns=lambda: T_NS)
    for row in range(count):
        answers.tags.register(NAMES[row] if row < len(NAMES) else f"tag-{row}")
    answers.tags.presence.set_token("plain", True)
    rng = np.random.default_rng(1)
    poses = np.zeros(count, POSE)
    for name in POSE.names or ():
        if poses[name].dtype.kind == "f":
            poses[name] = rng.normal(size=poses[name].shape) * 10.0 ** rng.integers(-12, 17, poses[name].shape)
            poses[name][rng.random(poses[name].shape) < 0.1] = math.nan
    poses["row"], poses["t_ns"] = np.arange(count), T_NS - rng.integers(0, 20_000_000_000, count)
    poses["state"], poses["reason"] = rng.integers(0, len(State), count), rng.integers(0, len(StateReason), count)
    poses["frame"] = rng.integers(0, len(Frame), count)
    poses["anchor"] = rng.integers(-1, 2, count)
    ambiguous = poses["row"][poses["state"] == State.AMBIGUOUS]
    modes = np.zeros(2 * len(ambiguous), HYPOTHESIS)
    modes["row"], modes["weight"], modes["cov"] = np.repeat(ambiguous, 2), 0.5, np.eye(2)
    answers.latest.write(poses, modes)
    return answers


def rounded(value: Any, decimals: int = DECIMALS) -> Any:
    """Return what is expected of a number in an answer, rounded."""
    match value:
        case dict():
            return {name: rounded(inner, FINE_DECIMALS if name in FINE else DECIMALS) for name, inner in value.items()}
        case list():
            return [rounded(inner, decimals) for inner in value]
        case float():
            return pytest.approx(value, rel=1e-15, abs=0.6 * 10.0**-decimals)
    return value


FINE = ("covariance", "lat", "lon")


@pytest.mark.parametrize("georeference", [None, Georeference(lat=48.0, lon=11.0)])
@pytest.mark.parametrize("count", [0, 1, 8, CHUNK + 1])
def test_the_answers_equal_those_from_dictionaries(count: int, georeference: Georeference | None) -> None:
    answers = answers_with(count, Site(anchors=[Anchor(id="17"), Anchor(id='"')], georeference=georeference))
    written, expected = json.loads(b"".join(answers.pose_list_json())), json.loads(to_json(answers.pose_list()))
    assert [list(pose) for pose in written["poses"]] == [list(pose) for pose in expected["poses"]]
    assert written == rounded(expected)


def test_each_pose_equals_that_in_the_list() -> None:
    answers = answers_with(8, Site(anchors=[Anchor(id="17")]))
    each = list(answers.pose_jsons(answers.rows(), T_NS))
    assert [name for name, _ in each] == NAMES
    assert b"[%b]" % b",".join(text for _, text in each) in b"".join(answers.pose_list_json())


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0.0, "0.0"),
        (-0.0, "0.0"),
        (1.0, "1.0"),
        (-2.5, "-2.5"),
        (0.0000004, "0.0"),
        (-0.0000004, "0.0"),
        (0.0000006, "0.000001"),
        (-0.0123456, "-0.012346"),
        (9.9999996, "10.0"),
        (123456.789, "123456.789"),
        (1e12, "1000000000000.0"),
        (-4e17, "-400000000000000000.0"),
        (8.9e18, "8900000000000000000.0"),
        (9e18, "null"),
        (-math.inf, "null"),
        (math.nan, "null"),
    ],
)
def test_a_number_has_six_decimals_at_most(number: float, text: str) -> None:
    one = filled([orjson.dumps(NUMBER)], np.zeros(1, np.int64), np.array([[number]]), np.array([DECIMALS]))
    assert bytes(one.all).decode() == text


def test_a_covariance_that_is_too_large_to_write_is_unknown() -> None:
    answers = answers_with(1, Site())
    poses = answers.rows()
    poses["cov"] = 1e300
    answers.latest.write(poses, np.empty(0, HYPOTHESIS))
    pose = json.loads(b"".join(answers.pose_list_json()))["poses"][0]
    assert pose["covariance"] is pose["ellipse_95"] is None


def test_chosen_tags_are_in_the_order_of_the_request() -> None:
    answers = answers_with(8, Site(anchors=[Anchor(id="17"), Anchor(id="18")]))
    chosen = [tag for name in ("null", "plain", ",") if (tag := answers.tags.find(name)) is not None]
    poses = json.loads(b"".join(answers.pose_list_json(chosen)))["poses"]
    assert [pose["tag"] for pose in poses] == ["null", "plain", ","]
