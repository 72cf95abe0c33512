"""Explanations, and poses at a time, over REST."""

import numpy as np
import pytest

from dropanchor_schemas.explain import Explanation, RangeErrors
from dropanchor_schemas.pose import Pose
from dropanchor_service.estimation.columns import HYPOTHESIS, INNOVATION, POSE, State
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench

SECOND = 1_000_000_000


def driven(seconds: float = 5.0, speed: float = 2.0) -> ApiBench:
    """A tag that has driven east until now, with ten poses a second."""
    bench = make_api_bench()
    for i in range(round(seconds * 10) + 1):
        bench.now_ns = T_NS - round((seconds - i / 10) * SECOND)
        bench.move("a", x=speed * i / 10, speed=speed, sigma_pos=0.2)
    return bench


def pose_at(bench: ApiBench, offset_s: float) -> Pose:
    path = f"/api/v1/tags/a/pose?at={T_NS + round(offset_s * SECOND)}"
    return Pose.model_validate(ask(bench.app(), "GET", path).json())


def problem_at(bench: ApiBench, offset_s: float) -> tuple[str, str]:
    response = ask(bench.app(), "GET", f"/api/v1/tags/a/pose?at={T_NS + round(offset_s * SECOND)}")
    return kind_of(response), response.json()["detail"]


def test_a_past_pose_is_interpolated_between_the_poses_in_memory() -> None:
    bench = driven()
    for offset_s in (-4.0, -3.33, -0.05, 0.0):
        pose = pose_at(bench, offset_s)
        assert pose.x == pytest.approx(10.0 + 2.0 * offset_s)
        assert pose.t_ns == T_NS + round(offset_s * SECOND)
        assert pose.age_s == pytest.approx(-offset_s)
        assert pose.state == "tracking"


def test_the_state_of_a_past_pose_does_not_age() -> None:
    bench = driven()
    bench.now_ns = T_NS + 20 * SECOND
    assert pose_at(bench, -2.0).state == "tracking"


def test_a_pose_in_the_near_future_is_extrapolated_with_a_growing_covariance() -> None:
    bench = driven()
    now, soon, later = (pose_at(bench, offset_s) for offset_s in (0.0, 0.5, 2.0))
    assert [soon.x, later.x] == pytest.approx([11.0, 14.0])
    sizes = [pose.ellipse_95.semi_major_m for pose in (now, soon, later) if pose.ellipse_95]
    assert len(sizes) == 3
    assert sizes == sorted(set(sizes))


def test_a_time_without_a_pose_is_refused_with_its_reason() -> None:
    bench = driven()
    assert problem_at(bench, 2.1)[0] == "too-far-ahead"
    kind, detail = problem_at(bench, -9.0)
    assert (kind, "begin" in detail) == ("no-pose-then", True)
    bench.now_ns = T_NS + 3 * SECOND
    bench.move("a", x=16.0, speed=2.0, sigma_pos=0.2)
    kind, detail = problem_at(bench, 1.5)
    assert (kind, "apart" in detail) == ("no-pose-then", True)


def test_a_jump_of_the_estimate_is_not_interpolated() -> None:
    bench = driven()
    bench.now_ns = T_NS + SECOND // 2
    bench.move("a", x=-30.0, speed=2.0, sigma_pos=0.2)
    kind, detail = problem_at(bench, 0.25)
    assert (kind, "jumped" in detail) == ("no-pose-then", True)


def test_an_ambiguous_pose_is_not_extrapolated() -> None:
    bench = driven()
    bench.now_ns = T_NS + SECOND // 10
    bench.move("a", x=10.2, speed=2.0, sigma_pos=2.0, state=State.AMBIGUOUS)
    assert problem_at(bench, 0.5)[0] == "no-pose-then"


@pytest.mark.parametrize("query", ["at=noon", "at=-1", "at=9223372036854775808", "when=5", "at=1&at=x"])
def test_an_invalid_time_is_refused(query: str) -> None:
    assert kind_of(ask(driven(0.1).app(), "GET", f"/api/v1/tags/a/pose?{query}")) == "invalid-request"


def explained_house() -> ApiBench:
    bench = driven()
    records = np.zeros(60, INNOVATION)
    records["t_ns"] = T_NS - np.arange(60)[::-1] * SECOND // 10
    records["predicted"] = 10.0 + 2.0 * (records["t_ns"] - T_NS) * 1e-9
    records["innovation"], records["S"], records["p_outlier"], records["fused"] = 0.1, 0.04, 0.02, True
    records["white_std"], records["lasting_std"] = 0.25, 0.5
    records["innovation"][-1], records["p_outlier"][-1], records["fused"][-1] = 3.0, 0.99, False
    records["measured"] = np.add(records["predicted"], records["innovation"])
    pose = np.zeros(1, POSE)
    pose["t_ns"], pose["state"], pose["speed"], pose["cov"] = T_NS + 1, State.TRACKING, 2.0, np.eye(3) * 0.01
    bench.answers.latest.write(pose, np.empty(0, HYPOTHESIS), records)
    return bench


def test_an_explanation_holds_the_last_innovations_and_the_range_rate() -> None:
    app = explained_house().app()
    explanation = Explanation.model_validate(ask(app, "GET", "/api/v1/tags/a/explain").json())
    assert len(explanation.innovations) == 50
    last = explanation.innovations[-1]
    assert (last.kind, last.anchor, last.fused) == ("range", "17", False)
    assert last.p_outlier == pytest.approx(0.99)
    assert last.nis == pytest.approx(9.0 / 0.04)
    assert explanation.refused == 1
    assert explanation.range_errors == RangeErrors(white_m=0.25, lasting_m=0.5)
    assert explanation.speed.predicted_range_rate_mps == pytest.approx(2.0)
    assert explanation.speed.range_rate_mps == pytest.approx(2.2, abs=0.3)
    assert len(explanation.speed_track.t_ns) == len(explanation.speed_track.speed_mps) >= 20
    assert set(explanation.speed_track.speed_mps) == {2.0}
    assert len(ask(app, "GET", "/api/v1/tags/a/explain?last=7").json()["innovations"]) == 7


def test_an_innovation_that_was_only_gated_has_no_outlier_probability() -> None:
    bench = make_api_bench()
    bench.move("a")
    record = np.zeros(1, INNOVATION)
    record["S"], record["p_outlier"], record["white_std"] = 1.0, np.nan, np.nan
    pose = bench.answers.latest.since()[1]
    bench.answers.latest.write(pose, np.empty(0, HYPOTHESIS), record)
    explanation = Explanation.model_validate(ask(bench.app(), "GET", "/api/v1/tags/a/explain").json())
    assert explanation.innovations[0].p_outlier is None
    assert explanation.range_errors is None


@pytest.mark.parametrize("query", ["last=0", "last=301", "last=x", "first=3"])
def test_an_invalid_query_for_an_explanation_is_refused(query: str) -> None:
    assert kind_of(ask(driven(0.1).app(), "GET", f"/api/v1/tags/a/explain?{query}")) == "invalid-request"


def test_an_unknown_tag_and_a_tag_without_a_pose_cannot_be_explained() -> None:
    bench = make_api_bench()
    bench.answers.tags.register("quiet")
    assert kind_of(ask(bench.app(), "GET", "/api/v1/tags/nobody/explain")) == "unknown-tag"
    assert kind_of(ask(bench.app(), "GET", "/api/v1/tags/quiet/explain")) == "no-pose-yet"
