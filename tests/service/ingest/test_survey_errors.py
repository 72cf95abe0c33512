"""What the survey of several anchors leaves open is part of a pose's ellipse."""

import numpy as np
import pytest

from dropanchor_schemas.wire import Frame as Message
from dropanchor_service.estimation.columns import INNOVATION, POSE, Array, Frame, PoseBatch, SampleBatch, anchors_at
from dropanchor_service.ingest.survey_errors import SURVEY_STD_M, widen
from service.ingest.messages import ranges
from support.ingest import IngestBench, TransparentEngine

FEW_CM = 0.05
ANCHORS = ((0.0, 0.0), (20.0, 0.0), (0.0, 20.0))


def widened(x: float, y: float, hears: int, frame: Frame = Frame.SITE) -> Array:
    """Return a pose that knows its place to a few cm by ranges to so many of the anchors."""
    poses = np.zeros(1, POSE)
    poses["x"], poses["y"], poses["frame"], poses["parts"] = x, y, frame, [[0.0, 0.0, 0.0, 0.0, FEW_CM, 0.0]]
    poses["sigma_pos"] = FEW_CM
    poses["cov"][0, :2, :2] = np.eye(2) * FEW_CM**2 / 2.0
    anchors, heard = np.array([[0, 1, 2, 0]]), np.arange(4)[None, :] < hears
    widen(poses, anchors, heard, anchors_at(*[(*place, 0.0) for place in ANCHORS]))
    return poses


def place_of(ranges: Array, anchors: Array, guess: Array) -> Array:
    """Return where ranges to these anchors meet."""
    place = guess
    for _ in range(10):
        away = place - anchors
        distance = np.hypot(*away.T)
        place = place + np.linalg.lstsq(away / distance[:, None], ranges - distance, rcond=None)[0]
    return place


@pytest.mark.parametrize(("x", "y", "hears"), [(10.0, 10.0, 2), (25.0, 30.0, 2), (12.0, -9.0, 3), (30.0, 35.0, 3)])
def test_errors_of_the_survey_shift_a_place_as_far_as_its_ellipse_says(x: float, y: float, hears: int) -> None:
    truth, told, rng = np.array([x, y]), np.array(ANCHORS[:hears]), np.random.default_rng(1)
    shifts = []
    for error in SURVEY_STD_M * rng.standard_normal((2000, hears, 2)):
        ranges = np.hypot(*(truth - told - error).T)
        shifts.append(place_of(ranges, told, truth) - truth)
    pose = widened(x, y, hears)
    added = pose["cov"][0, :2, :2] - np.eye(2) * FEW_CM**2 / 2.0
    seen = np.cov(np.array(shifts).T)
    assert np.linalg.norm(added - seen) < 0.25 * np.linalg.norm(seen)
    assert np.sum(pose["parts"] ** 2) == pytest.approx(np.trace(pose["cov"][0, :2, :2]))
    assert pose["sigma_pos"][0] ** 2 == pytest.approx(np.trace(pose["cov"][0, :2, :2]))


@pytest.mark.parametrize(("hears", "frame"), [(1, Frame.SITE), (2, Frame.RELATIVE)])
def test_the_survey_says_nothing_about_a_tag_of_one_anchor_or_in_a_frame_of_its_own(hears: int, frame: Frame) -> None:
    assert widened(10.0, 10.0, hears, frame)["sigma_pos"][0] == FEW_CM


def test_a_tag_on_the_line_of_its_anchors_is_wide_and_no_wider_than_the_imu_allows() -> None:
    assert 0.3 < widened(40.0, 0.0, 2)["sigma_pos"][0] < 0.6


class Tracking(TransparentEngine):
    """An engine whose tracks agree with every range."""

    def process(self, samples: SampleBatch) -> PoseBatch:
        batch = super().process(samples)
        found = np.zeros(len(batch.poses), INNOVATION)
        for name in ("row", "t_ns", "anchor"):
            found[name] = batch.poses[name]
        found["S"] = 0.01
        return PoseBatch(poses=batch.poses, innovations=found)


@pytest.mark.parametrize(("anchors", "is_wider"), [([7, 7], False), ([7, 8], True)])
def test_a_pose_is_wider_once_its_tag_hears_a_second_anchor(anchors: list[int], is_wider: bool) -> None:
    bench = IngestBench(engine=Tracking(), site={"anchors": [{"id": "7"}, {"id": "8", "x": 20.0}]})
    one, t0_ns = ranges(30.0).ranges[0], bench.clock.now_ns() - 1_000_000_000
    for k, anchor in enumerate(anchors):
        bench.send("a", Message(ranges=[one._replace(t_ns=t0_ns + k * 100_000_000, anchor=anchor)]))
    pose = bench.latest.row(0)
    assert pose is not None
    assert (pose["sigma_pos"] > 0.05) == is_wider
