"""Measure the JSON of many poses: our templates against libraries that write an object per pose."""

import json
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import msgspec
import numpy as np
import pytest

from benchmarks import report
from dropanchor_schemas.site import Anchor, Site
from dropanchor_service.answers.answers import Answers, to_json
from dropanchor_service.answers.columns import PoseColumns, columns_of, ellipse_95
from dropanchor_service.answers.pose_fields import POSE_FIELDS
from dropanchor_service.engines.warm_up import warm_up_answers
from dropanchor_service.estimation.columns import HYPOTHESIS, POSE, Array, State, StateReason
from dropanchor_service.store import LatestPoses, SiteStore, TagTable

pytestmark = pytest.mark.benchmark

T_NS = 1_800_000_000_000_000_000
MANY, ROUNDS = 10_000, 15
AMBIGUOUS, MODES = 0.05, 4  # share of ambiguous tags, and hypotheses of each


class Ellipse(msgspec.Struct):
    semi_major_m: float
    semi_minor_m: float
    angle_rad: float


class Hypothesis(msgspec.Struct):
    weight: float
    x: float
    y: float
    heading_rad: float
    speed_mps: float
    ellipse_95: Ellipse | None


Pose = msgspec.defstruct("Pose", list(POSE_FIELDS))


class PoseList(msgspec.Struct):
    t_ns: int
    poses: list[Any]


def test_a_pose_list_from_rows_to_bytes() -> None:
    warm_up_answers()
    lines = []
    for count in (1, MANY):
        answers = answers_of(count)
        ways: dict[str, Callable[[], bytes]] = {
            "ours": partial(encode_with_templates, answers),
            "msgspec": partial(encode_with_msgspec, answers),
            "orjson": partial(encode_with_orjson, answers),
        }
        ours, *others = (json.loads(way()) for way in ways.values())
        assert all(is_same(ours, other) for other in others)
        cost = costs_ms(ways)
        costs = ", ".join(f"{name} {ms:.3f} ms ({ms / cost['ours']:.2f} times ours)" for name, ms in cost.items())
        lines.append(f"Processor time from the rows of {count:,} poses to JSON: {costs}.")
    report.record("pose-json", "\n".join(lines))


def answers_of(count: int) -> Answers:
    """Return answers for tags in all states, some of them ambiguous."""
    answers = Answers(SiteStore(Site(anchors=[Anchor(id="17")]), {}), TagTable(), LatestPoses(), now_ns=lambda: T_NS)
    rng = np.random.default_rng(1)
    poses = np.zeros(count, POSE)
    for row in range(count):
        answers.tags.register(f"tag-{row}")
    for name in ("x", "y", "heading", "speed", "yaw_rate", "p_mode", "sigma_pos", "sigma_obs", "range"):
        poses[name] = rng.normal(size=count) * 10
    poses["cov"] = np.eye(3) * rng.uniform(0.01, 1.0, (count, 1, 1))
    poses["row"], poses["t_ns"] = np.arange(count), T_NS - rng.integers(0, 5_000_000_000, count)
    poses["state"] = rng.choice([state for state in State if state != State.AMBIGUOUS], count)
    poses["state"][rng.random(count) < AMBIGUOUS] = State.AMBIGUOUS
    poses["reason"] = rng.integers(0, len(StateReason), count)
    ambiguous = poses["row"][poses["state"] == State.AMBIGUOUS]
    modes = np.zeros(MODES * len(ambiguous), HYPOTHESIS)
    modes["row"], modes["weight"], modes["cov"] = np.repeat(ambiguous, MODES), 1 / MODES, np.eye(2)
    answers.latest.write(poses, modes)
    return answers


def encode_with_templates(answers: Answers) -> bytes:
    return b"".join(answers.pose_list_json())


def encode_with_orjson(answers: Answers) -> bytes:
    return to_json(answers.pose_list())


def encode_with_msgspec(answers: Answers) -> bytes:
    columns = columns_of(answers.rows(), answers.site, answers.tags, T_NS)
    every = PoseList(T_NS, [Pose(*values) for values in zip(*fields(columns, answers), strict=True)])
    return msgspec.json.encode(every, enc_hook=str)  # a hint is a string of another class


def fields(columns: PoseColumns, answers: Answers) -> Iterator[Any]:
    """Yield the values of each field of `Pose`."""
    for name, field in POSE_FIELDS.items():
        match name:
            case "ellipse_95":
                yield ellipses(np.stack([columns.semi_major_m, columns.semi_minor_m, columns.angle_rad]))
            case "hypotheses":
                yield hypotheses(columns.poses, answers)
            case _:
                yield field.values(columns)


def ellipses(axes: Array) -> list[Ellipse]:
    return [Ellipse(*values) for values in zip(*axes.tolist(), strict=True)]


def hypotheses(poses: Array, answers: Answers) -> list[list[Hypothesis]]:
    """Return the hypotheses of each pose, which are read together."""
    ambiguous = poses["state"] == State.AMBIGUOUS
    modes, counts = answers.latest.hypotheses_of(poses["row"][ambiguous])
    numbers = (modes[name].tolist() for name in ("weight", "x", "y", "heading", "speed"))
    each = iter([Hypothesis(*values) for values in zip(*numbers, ellipses(ellipse_95(modes["cov"])), strict=True)])
    of_each = iter([[next(each) for _ in range(count)] for count in counts.tolist()])
    return [next(of_each) if several else [] for several in ambiguous.tolist()]


def costs_ms(ways: dict[str, Callable[[], bytes]]) -> dict[str, float]:
    """Return the CPU time of the fastest round of each way in ms. The ways take turns."""
    best = dict.fromkeys(ways, float("inf"))
    for _ in range(ROUNDS):
        for name, way in ways.items():
            began = time.process_time()
            way()
            best[name] = min(best[name], (time.process_time() - began) * 1e3)
    return best


def is_same(one: Any, other: Any) -> bool:
    """Return whether two documents are equal apart from the digits that our templates leave out."""
    match one:
        case dict():
            return one.keys() == other.keys() and all(is_same(one[name], other[name]) for name in one)
        case list():
            return len(one) == len(other) and all(map(is_same, one, other))
        case float():
            return bool(abs(one - other) < 1e-6)
    return bool(one == other)
