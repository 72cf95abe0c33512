"""A tag in a frame of its own that later finds north: no interface gives it a place of the site before."""

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pyarrow.parquet as pq
import pytest

from dropanchor_schemas.pose import Pose, PoseFrame, TrackingState
from dropanchor_service.answers.answers import to_json
from dropanchor_service.answers.site_summaries import summaries
from dropanchor_service.api.routes.stream import Changes
from dropanchor_service.estimation.columns import HYPOTHESIS, Frame, State, StateReason
from dropanchor_service.history.storage import Retention
from dropanchor_service.store import LatestPoses
from service.api.routes.test_track import GEOREFERENCED, SECOND
from support.api import T_NS, ApiBench, ask, make_api_bench

OWN, FOUND = (3.0, 4.0), (-4.0, 3.0)
"""The place of the tag in its own frame, and then in the site frame: 5 m from the anchor."""
OF_THE_SITE = ("x", "y", "heading_rad", "covariance", "p_mode", "sigma_pos_m", "lat", "lon")
FOUND_NS = T_NS - 10 * SECOND
EVERY_SECOND = Retention(SECOND, 0.0, 5 * SECOND, 10**18, 2**40)


def move(bench: ApiBench, north: bool, **fields: Any) -> None:
    x, y = FOUND if north else OWN
    frame = Frame.SITE if north else Frame.RELATIVE
    bench.move("a", x=x, y=y, heading=0.5, speed=1.5, sigma_pos=0.2, range=5.0, anchor=0, frame=frame, **fields)


@pytest.fixture
def bench(tmp_path: Path) -> ApiBench:
    """A tag that knows north for ten seconds, and did not for ten seconds before."""
    bench = make_api_bench(GEOREFERENCED, tmp_path, EVERY_SECOND)
    for second in range(-20, 1):
        bench.now_ns = T_NS + second * SECOND
        move(bench, north=bench.now_ns >= FOUND_NS)
    bench.write_history()
    return bench


def answered(bench: ApiBench, path: str, **headers: str) -> Any:
    response = ask(bench.app(), "GET", f"/api/v1/{path}", headers=headers)
    assert response.status_code == 200, response.text
    return response


def assert_only_in_its_own_frame(pose: dict[str, Any]) -> None:
    assert (pose["state"], pose["frame"]) == ("relative", "relative")
    assert [pose.get(name) for name in OF_THE_SITE] == [None] * len(OF_THE_SITE)
    assert (pose["relative_pose"]["x"], pose["relative_pose"]["y"]) == OWN
    assert pose["relative_pose"]["covariance"][0][0] == pytest.approx(0.04)
    assert (pose["range_m"], pose["speed_mps"]) == (5.0, 1.5)


def single(bench: ApiBench) -> Any:
    return answered(bench, "tags/a/pose").json()


def listed(bench: ApiBench) -> Any:
    return answered(bench, "poses").json()["poses"][0]


def feature(bench: ApiBench) -> Any:
    found = answered(bench, "poses", accept="application/geo+json").json()["features"][0]
    assert (found["geometry"] is None) == (found["properties"]["state"] == "relative")
    return found["properties"]


def published(bench: ApiBench) -> Any:
    """Return what is published over Zenoh when the pose changes."""
    ((_, text),) = bench.answers.pose_jsons(bench.answers.rows(), bench.now_ns)
    return json.loads(text)


@pytest.mark.parametrize("read", [single, listed, feature, published])
def test_a_pose_has_coordinates_of_the_site_only_once_north_is_found(read: Callable[[ApiBench], Any]) -> None:
    bench = make_api_bench(GEOREFERENCED)
    move(bench, north=False)
    assert_only_in_its_own_frame(read(bench))
    bench.now_ns += SECOND
    move(bench, north=True)
    pose = read(bench)
    assert (pose["state"], pose["x"], pose["y"], pose["relative_pose"]) == ("tracking", *FOUND, None)


@pytest.mark.parametrize("state", [State.TRACKING, State.COASTING, State.DEGRADED])
def test_whatever_is_placed_without_north_is_relative_and_says_why_it_is_not_better(state: State) -> None:
    bench = make_api_bench(GEOREFERENCED)
    move(bench, north=False, state=state, reason=StateReason.RANGES_MISSING)
    pose = Pose.model_validate(single(bench))
    assert (pose.state, pose.reason) == (TrackingState.RELATIVE, "ranges_missing")


def test_a_lost_tag_without_north_is_lost_and_still_has_no_place_of_the_site() -> None:
    bench = make_api_bench(GEOREFERENCED)
    move(bench, north=False)
    bench.now_ns += 60 * SECOND
    pose = single(bench)
    assert (pose["state"], pose["x"], pose["lat"], pose["relative_pose"]["x"]) == ("lost", None, None, OWN[0])


@pytest.mark.parametrize("north", [False, True])
def test_hypotheses_are_of_the_site_only_when_north_is_known(north: bool) -> None:
    bench = make_api_bench(GEOREFERENCED)
    move(bench, north)
    modes = np.zeros(2, HYPOTHESIS)
    modes["weight"], modes["x"], modes["cov"] = 0.5, 7.0, np.eye(2)
    pose = bench.answers.rows()
    pose["state"] = State.AMBIGUOUS
    bench.answers.latest.write(pose, modes)
    frame = json.loads(to_json(bench.answers.frame_of(bench.answers.rows(), bench.now_ns)))
    column = {"hypotheses": frame["hypotheses"][0], "relative_pose": frame["relative_pose"][0]}
    for found in (single(bench), listed(bench), published(bench), column):
        own = found["relative_pose"]
        assert len(found["hypotheses"] or []) == (2 if north else 0)
        assert own is None if north else [one["x"] for one in own["hypotheses"]] == [7.0, 7.0]


def test_a_stream_gives_columns_of_the_site_and_the_place_in_the_own_frame_beside_them() -> None:
    bench = make_api_bench(GEOREFERENCED)
    move(bench, north=False)
    changes = Changes(bench.answers, list, [])
    frame = PoseFrame.model_validate_json(to_json(changes.snapshot()))
    assert (frame.state, frame.x, frame.y, frame.heading_rad, frame.semi_major_m) == (["relative"], *[[None]] * 4)
    assert (frame.lat, frame.range_m, frame.speed_mps) == ([None], [5.0], [1.5])
    own = frame.relative_pose[0]
    assert own is not None
    assert ((own.x, own.y), own.ellipse_95 is None, own.hypotheses) == (OWN, False, [])
    bench.now_ns += SECOND
    move(bench, north=True)
    found = PoseFrame.model_validate_json(to_json(changes.next()))
    assert (found.state, found.x, found.relative_pose) == (["tracking"], [FOUND[0]], [None])


def test_filters_and_counts_know_the_state() -> None:
    bench = make_api_bench(GEOREFERENCED)
    move(bench, north=False)
    assert len(answered(bench, "poses?state=relative").json()["poses"]) == 1
    assert answered(bench, "poses?state=tracking").json()["poses"] == []
    assert answered(bench, "poses?box=-9,-9,9,9").json()["poses"] == []
    (summary,) = summaries([bench.answers], ["default"])
    assert summary["states"] == {"relative": 1}


def test_the_pose_at_a_time_is_in_the_frame_that_was_known_then(bench: ApiBench) -> None:
    bench.answers.latest = LatestPoses()
    assert_only_in_its_own_frame(answered(bench, f"tags/a/pose?at={FOUND_NS - 5 * SECOND}").json())
    assert answered(bench, f"tags/a/pose?at={FOUND_NS + 5 * SECOND}").json()["x"] == FOUND[0]
    between = ask(bench.app(), "GET", f"/api/v1/tags/a/pose?at={FOUND_NS - SECOND // 2}")
    assert (between.status_code, "frame" in between.text) == (404, True)


@pytest.mark.parametrize("path", ["track", "track/file"])
def test_a_track_turns_from_relative_to_tracking_when_north_is_found(bench: ApiBench, path: str) -> None:
    rows = answered(bench, f"tags/a/{path}?format=json").json()["poses"]
    own, placed = [row for row in rows if row["t_ns"] < FOUND_NS], [row for row in rows if row["t_ns"] >= FOUND_NS]
    assert (len(own), len(placed)) == (10, 11)
    for row in own:
        assert_only_in_its_own_frame(row)
    assert {(row["state"], row["x"], row["relative_pose"], row["epoch"]) for row in placed} == {
        ("tracking", FOUND[0], None, 0)
    }
    features = answered(bench, f"tags/a/{path}?format=geojson").json()["features"]
    assert [one["geometry"] is None for one in features] == [True] * 10 + [False] * 11
    gpx = ElementTree.fromstring(answered(bench, f"tags/a/{path}?format=gpx").text)
    assert len(list(gpx.iter("{http://www.topografix.com/GPX/1/1}trkpt"))) == 11


def test_tables_have_columns_of_their_own_for_the_own_frame(bench: ApiBench) -> None:
    table = list(csv.DictReader(io.StringIO(answered(bench, "tags/a/track/file?format=csv").text)))
    columns = ("state", "x", "y", "lat", "var_x", "relative_x", "relative_y", "relative_var_x", "epoch")
    own, placed = ([table[place][name] for name in columns] for place in (0, -1))
    assert own == ["relative", "", "", "", "", "3.0", "4.0", "0.04", "0"]
    assert (placed[:3], placed[5:]) == (["tracking", "-4.0", "3.0"], ["", "", "", "0"])
    content = answered(bench, "tags/a/track/file?format=parquet").content
    rows = pq.read_table(io.BytesIO(content)).to_pylist()
    first, last = ([row[name] for name in columns] for row in (rows[0], rows[-1]))
    assert first == ["relative", None, None, None, None, 3.0, 4.0, pytest.approx(0.04), 0]
    assert (last[:3], last[5:]) == (["tracking", -4.0, 3.0], [None, None, None, 0])


def test_the_tracks_of_many_tags_keep_the_moment_at_which_north_is_found(bench: ApiBench) -> None:
    (track,) = answered(bench, "tracks?max_points=4").json()["tracks"]
    points = track["points"]
    change = points["t_ns"].index(FOUND_NS)
    assert (points["state"][change - 1], points["state"][change]) == ("relative", "tracking")
    assert {points["x"][i] for i in range(change)} == {None}
    assert (points["relative_pose"][0]["x"], points["relative_pose"][change]) == (OWN[0], None)
    assert (points["x"][change], points["since_previous"][change]) == (FOUND[0], "unknown")
    assert (track["tracked_s"], track["distance_m"]) == (10, 0)
