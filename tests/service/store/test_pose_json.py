"""Poses written by columns are the bytes of poses written one by one."""

import math

import numpy as np
import pytest

from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_service.estimation.batch import HYPOTHESIS, POSE, State, StateReason
from dropanchor_service.store import LatestPoses, SiteStore, TagTable
from dropanchor_service.store.answers import Answers, to_json
from dropanchor_service.store.pose_json import CHUNK

T_NS = 1_800_000_000_000_000_000
NAMES = ["plain", 'a","b', "back\\", '\\"', "ü/ß", ",", "]],[[", "null"]


def answers_with(count: int, site: Site) -> Answers:
    answers = Answers(SiteStore(site, {}), TagTable(), LatestPoses(), now_ns=lambda: T_NS)
    for row in range(count):
        answers.tags.register(NAMES[row] if row < len(NAMES) else f"tag-{row}")
    answers.tags.set_online("plain", True)
    rng = np.random.default_rng(1)
    poses = np.zeros(count, POSE)
    for name in POSE.names or ():
        if poses[name].dtype.kind == "f":
            poses[name] = rng.normal(size=poses[name].shape) * 10.0 ** rng.integers(-20, 20, poses[name].shape)
            poses[name][rng.random(poses[name].shape) < 0.1] = math.nan
    poses["row"], poses["t_ns"] = np.arange(count), T_NS - rng.integers(0, 20_000_000_000, count)
    poses["state"], poses["reason"] = rng.integers(0, len(State), count), rng.integers(0, len(StateReason), count)
    poses["anchor"] = rng.integers(-1, 2, count)
    ambiguous = poses["row"][poses["state"] == State.AMBIGUOUS]
    modes = np.zeros(2 * len(ambiguous), HYPOTHESIS)
    modes["row"], modes["weight"], modes["cov"] = np.repeat(ambiguous, 2), 0.5, np.eye(2)
    answers.latest.write(poses, modes)
    return answers


@pytest.mark.parametrize("georeference", [None, Georeference(lat=48.0, lon=11.0)])
@pytest.mark.parametrize("count", [0, 1, 8, CHUNK, 2 * CHUNK + 1])
def test_the_bytes_are_those_of_dictionaries(count: int, georeference: Georeference | None) -> None:
    answers = answers_with(count, Site(anchors=[Anchor(id="17"), Anchor(id='"')], georeference=georeference))
    assert b"".join(answers.pose_list_json()) == to_json(answers.pose_list())


def test_chosen_tags_come_in_the_order_in_which_they_were_asked_for() -> None:
    answers = answers_with(8, Site(anchors=[Anchor(id="17"), Anchor(id="18")]))
    chosen = [tag for name in ("null", "plain", ",") if (tag := answers.tags.find(name)) is not None]
    assert b"".join(answers.pose_list_json(chosen)) == to_json(answers.pose_list(chosen))
