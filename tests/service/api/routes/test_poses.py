"""Poses over REST: one, many, and as GeoJSON."""

import numpy as np
import pytest

from dropanchor_schemas.pose import Pose, PoseList
from dropanchor_schemas.site import Georeference, Site
from support.api import T_NS, ask, kind_of, make_api_bench

GEOREFERENCED = Site(georeference=Georeference(lat=52.5, lon=13.4))


def test_the_pose_of_a_tag_is_its_latest_one() -> None:
    bench = make_api_bench()
    bench.move("a", x=1.0)
    bench.move("a", x=2.0, heading=0.5)
    pose = Pose.model_validate(ask(bench.app(), "GET", "/api/v1/tags/a/pose").json())
    assert (pose.tag, pose.x, pose.heading_rad, pose.t_ns) == ("a", 2.0, 0.5, T_NS)


def test_an_unknown_tag_and_a_tag_without_a_pose_are_different_problems() -> None:
    bench = make_api_bench()
    bench.answers.tags.register("quiet")
    app = bench.app()
    assert kind_of(ask(app, "GET", "/api/v1/tags/nobody/pose")) == "unknown-tag"
    assert kind_of(ask(app, "GET", "/api/v1/tags/quiet/pose")) == "no-pose-yet"


def test_an_id_may_contain_any_printable_character_even_a_slash() -> None:
    bench = make_api_bench()
    bench.move("a/pose", x=1.0)
    bench.move("Gerät 7%", x=2.0)
    app = bench.app()
    assert ask(app, "GET", "/api/v1/tags/a%2Fpose/pose").json()["tag"] == "a/pose"
    assert ask(app, "GET", "/api/v1/tags/Ger%C3%A4t%207%25/pose").json()["x"] == 2.0


@pytest.mark.parametrize("chunk", ["%FF", "x" * 65, "%00", "%0A"])
def test_an_invalid_id_is_a_problem(chunk: str) -> None:
    for path in (f"/api/v1/tags/{chunk}/pose", f"/api/v1/tags/{chunk}", f"/api/v1/anchors/{chunk}"):
        assert kind_of(ask(make_api_bench().app(), "GET", path)) == "invalid-request"


def test_a_list_holds_all_poses_or_the_selected_ones() -> None:
    bench = make_api_bench()
    bench.move("a", "b", "c")
    app = bench.app()
    all_poses = PoseList.model_validate(ask(app, "GET", "/api/v1/poses").json())
    assert all_poses.t_ns == T_NS
    assert [pose.tag for pose in all_poses.poses] == ["a", "b", "c"]
    for query in ("tags=c,a,nobody", "tags=c&tags=a"):
        assert [pose["tag"] for pose in ask(app, "GET", f"/api/v1/poses?{query}").json()["poses"]] == ["c", "a"]
    assert ask(app, "GET", "/api/v1/poses?tags=nobody").json()["poses"] == []


@pytest.mark.parametrize("query", ["tags=", "tags=a,,b", "tag=a", "limit=3", "tags=%00", "tags=" + "x" * 65])
def test_an_invalid_query_is_a_problem(query: str) -> None:
    assert kind_of(ask(make_api_bench().app(), "GET", f"/api/v1/poses?{query}")) == "invalid-request"


def test_a_single_pose_accepts_only_a_time_as_its_query() -> None:
    assert kind_of(ask(make_api_bench().app(), "GET", "/api/v1/tags/a/pose?tags=a")) == "invalid-request"


def test_geojson_has_longitude_before_latitude_and_null_for_an_unknown_position() -> None:
    bench = make_api_bench(GEOREFERENCED)
    bench.move("a", x=1000.0)
    bench.move("b", x=np.nan, y=np.nan)
    response = ask(bench.app(), "GET", "/api/v1/poses", headers={"accept": "application/geo+json"})
    assert response.headers["content-type"] == "application/geo+json"
    assert response.headers["vary"] == "accept"
    collection = response.json()
    assert collection["type"] == "FeatureCollection"
    known, unknown = collection["features"]
    assert (known["type"], known["id"], known["geometry"]["type"]) == ("Feature", "a", "Point")
    assert known["geometry"]["coordinates"] == pytest.approx([13.41473, 52.5], abs=1e-5)
    assert known["properties"]["state"] == "tracking"
    assert unknown["geometry"] is None


def test_one_pose_is_a_feature() -> None:
    bench = make_api_bench(GEOREFERENCED)
    bench.move("a")
    feature = ask(bench.app(), "GET", "/api/v1/tags/a/pose", headers={"accept": "application/geo+json"}).json()
    assert (feature["type"], feature["geometry"]["coordinates"]) == ("Feature", pytest.approx([13.4, 52.5]))


@pytest.mark.parametrize("path", ["/api/v1/poses", "/api/v1/tags/a/pose"])
def test_the_address_may_name_the_form_instead_of_the_header(path: str) -> None:
    bench = make_api_bench(GEOREFERENCED)
    bench.move("a")
    header = {"accept": "application/geo+json"}
    named = ask(bench.app(), "GET", f"{path}?format=geojson")
    assert named.headers["content-type"] == "application/geo+json"
    assert named.json()["type"] == ask(bench.app(), "GET", path, headers=header).json()["type"]
    assert ask(bench.app(), "GET", f"{path}?format=json", headers=header).headers["content-type"] == "application/json"
    assert kind_of(ask(bench.app(), "GET", f"{path}?format=shp")) == "invalid-request"
    assert kind_of(ask(make_api_bench().app(), "GET", "/api/v1/poses?format=geojson")) == "not-georeferenced"


def test_geojson_without_a_georeference_says_what_to_do() -> None:
    response = ask(make_api_bench().app(), "GET", "/api/v1/poses", headers={"accept": "application/geo+json"})
    assert kind_of(response) == "not-georeferenced"
    assert "georeference" in response.json()["detail"]


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("*/*", "application/json"),
        ("application/*", "application/json"),
        ("text/html, application/json;q=0.5", "application/json"),
        ("Application/GEO+JSON", "application/geo+json"),
        ("application/json;q=0.5, application/geo+json", "application/geo+json"),
        ("application/geo+json;q=nonsense, */*;q=0.1", "application/json"),
        ("application/geo+json;q=nan, */*;q=0.1", "application/json"),
    ],
)
def test_the_client_chooses_the_media_type(accept: str, media_type: str) -> None:
    app = make_api_bench(GEOREFERENCED).app()
    assert ask(app, "GET", "/api/v1/poses", headers={"accept": accept}).headers["content-type"] == media_type


def test_a_media_type_that_is_not_offered_is_a_problem() -> None:
    assert (
        kind_of(ask(make_api_bench().app(), "GET", "/api/v1/poses", headers={"accept": "text/csv"})) == "not-acceptable"
    )
