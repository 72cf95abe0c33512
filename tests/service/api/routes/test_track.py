"""Tracks over REST, and poses from the stored history."""

import csv
import io
import math
from pathlib import Path
from xml.etree import ElementTree

import pytest

from dropanchor_schemas.geojson import TrackFeatureCollection
from dropanchor_schemas.pose import Pose
from dropanchor_schemas.site import Anchor, Georeference, Site
from dropanchor_schemas.track import Track
from dropanchor_service.estimation.columns import HeightSource, State
from dropanchor_service.history.storage import Retention
from dropanchor_service.store import LatestPoses
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench

SECOND = 1_000_000_000
RETENTION = Retention(SECOND, 0.1, 5 * SECOND, 10**18, 2**40)
GEOREFERENCED = Site(anchors=[Anchor(id="17")], georeference=Georeference(lat=52.5, lon=13.4))
SECONDS = 600
KML, GX = "{http://www.opengis.net/kml/2.2}", "{http://www.google.com/kml/ext/2.2}"
GPX = "{http://www.topografix.com/GPX/1/1}"


def driven(folder: Path, site: Site | None = None) -> ApiBench:
    """A tag that drove east at 2 m/s for ten minutes. Its poses are only in the stored history."""
    bench = make_api_bench(site, folder, RETENTION)
    for second in range(SECONDS + 1):
        bench.now_ns = T_NS - (SECONDS - second) * SECOND
        bench.move("a", x=2.0 * second, speed=2.0, sigma_pos=0.2, anchor=0)
    bench.write_history()
    bench.answers.latest = LatestPoses()
    return bench


def track(bench: ApiBench, query: str = "") -> Track:
    response = ask(bench.app(), "GET", f"/api/v1/tags/a/track?{query}")
    assert response.status_code == 200, response.text
    return Track.model_validate(response.json())


def test_a_track_covers_the_last_hour_by_default(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    default = track(bench)
    assert (len(default.poses), default.next) == (SECONDS + 1, None)
    assert default.to_ns - default.from_ns == 3600 * SECOND
    selected = track(bench, f"from={T_NS - 20 * SECOND}&to={T_NS - 10 * SECOND}")
    assert [(pose.t_ns - T_NS) // SECOND for pose in selected.poses] == list(range(-20, -9))
    last = selected.poses[-1]
    assert (last.x, last.speed_mps, last.anchor, last.state) == (1180.0, 2.0, "17", "tracking")
    assert last.covariance == [[0.04, 0, 0], [0, 0.01, 0], [0, 0, 0.001]]


def test_pages_follow_each_other_without_a_gap(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    found, path = [], f"/api/v1/tags/a/track?to={T_NS}&limit=250"
    while path:
        response = ask(bench.app(), "GET", path)
        page = Track.model_validate(response.json())
        found += [pose.t_ns for pose in page.poses]
        link = response.headers.get("link", "")
        assert (page.next is None) == (link == "")
        path = "/api/v1/tags/a/track" + link.partition(">")[0].strip("<") if link else ""
    assert found == [T_NS - second * SECOND for second in range(SECONDS, -1, -1)]


def test_csv_has_every_column_and_latitudes_only_on_a_georeferenced_site(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    response = ask(bench.app(), "GET", "/api/v1/tags/a/track", headers={"accept": "text/csv"})
    rows = list(csv.DictReader(io.StringIO(response.text)))
    assert response.headers["content-type"].startswith("text/csv")
    assert (len(rows), rows[5]["x"], rows[5]["var_x"], rows[5]["state"]) == (SECONDS + 1, "10.0", "0.04", "tracking")
    assert "lat" not in rows[0]


@pytest.mark.parametrize("form", ["geojson", "gpx", "kml"])
def test_formats_for_maps_need_a_georeference(tmp_path: Path, form: str) -> None:
    assert kind_of(ask(driven(tmp_path).app(), "GET", f"/api/v1/tags/a/track?format={form}")) == "not-georeferenced"


def test_gpx_and_geojson_hold_geographic_coordinates(tmp_path: Path) -> None:
    bench = driven(tmp_path, GEOREFERENCED)
    gpx = ask(bench.app(), "GET", "/api/v1/tags/a/track?format=gpx")
    points = list(ElementTree.fromstring(gpx.text).iter(f"{GPX}trkpt"))
    assert (gpx.headers["content-type"], len(points)) == ("application/gpx+xml", SECONDS + 1)
    assert points[-1][0].text == "2027-01-15T08:00:00.000Z"
    metres = (float(points[-1].attrib["lon"]) - 13.4) * math.radians(1) * 6_378_137 * math.cos(math.radians(52.5))
    assert metres == pytest.approx(2.0 * SECONDS, rel=5e-3)
    accept = {"accept": "application/geo+json"}
    features = ask(bench.app(), "GET", "/api/v1/tags/a/track", headers=accept).json()["features"]
    assert features[-1]["geometry"]["coordinates"][0] == pytest.approx(float(points[-1].attrib["lon"]))
    assert features[-1]["properties"]["covariance"][0][0] == 0.04


def test_kml_holds_times_and_places_in_a_track_for_each_stretch_without_a_gap(tmp_path: Path) -> None:
    bench = driven(tmp_path, GEOREFERENCED)
    bench.now_ns += 60 * SECOND
    for x in (0.0, 7.0, 14.0):
        bench.move("a", x=x)
        bench.now_ns += SECOND
    bench.write_history()
    kml = ask(bench.app(), "GET", "/api/v1/tags/a/track?format=kml")
    assert kml.headers["content-type"] == "application/vnd.google-earth.kml+xml"
    root = ElementTree.fromstring(kml.text)
    assert [name.text for name in root.iter(f"{KML}name")] == ["a"]
    first, second = root.iter(f"{GX}Track")
    whens, places = ([one.text for one in first.iter(tag)] for tag in (f"{KML}when", f"{GX}coord"))
    assert (len(whens), len(places), whens[-1]) == (SECONDS + 1, SECONDS + 1, "2027-01-15T08:00:00.000Z")
    assert [mode.text for mode in first.iter(f"{KML}altitudeMode")] == ["clampToGround"]
    lon, lat, _ = map(float, str(places[-1]).split())
    gpx = ElementTree.fromstring(ask(bench.app(), "GET", "/api/v1/tags/a/track?format=gpx").text)
    point = list(gpx.iter(f"{GPX}trkpt"))[SECONDS].attrib
    assert (lon, lat) == (float(point["lon"]), float(point["lat"]))
    assert len(list(second.iter(f"{GX}coord"))) == 3


def test_exports_have_heights_and_altitudes_where_that_of_the_site_is_known(tmp_path: Path) -> None:
    on_a_hill = Site(anchors=[Anchor(id="17")], georeference=Georeference(lat=52.5, lon=13.4, alt_m=34.5))
    bench = make_api_bench(on_a_hill, tmp_path, RETENTION)
    bench.move("a", x=1.0, z=3.25, z_std=0.25, z_source=HeightSource.PRESSURE)
    bench.now_ns += SECOND
    bench.move("a", x=2.0, z=math.nan, z_std=math.nan)  # stored before heights were
    bench.write_history()

    def exported(form: str) -> str:
        window = f"from={T_NS}&to={T_NS + SECOND}"
        return ask(bench.app(), "GET", f"/api/v1/tags/a/track?{window}&format={form}").text

    points = ElementTree.fromstring(exported("gpx")).iter(f"{GPX}trkpt")
    inside = [[child.tag.removeprefix(GPX) for child in point] for point in points]
    assert inside == [["ele", "time", "type"], ["time", "type"]]  # in the order of the standard
    assert "<ele>37.750</ele>" in exported("gpx")
    assert "clampToGround" in exported("kml")  # one altitude is not known
    known = ask(bench.app(), "GET", f"/api/v1/tags/a/track?from={T_NS}&to={T_NS}&format=kml").text
    assert ("<altitudeMode>absolute" in known, " 37.750</gx:coord>" in known) == (True, True)
    features = TrackFeatureCollection.model_validate_json(exported("geojson")).features
    heights = [feature.geometry.coordinates[2:] for feature in features if feature.geometry is not None]
    assert heights == [[37.75], []]
    row, empty = csv.DictReader(io.StringIO(exported("csv")))
    names = ("z", "z_std_m", "z_source", "alt_m")
    assert [row[name] for name in names] == ["3.25", "0.25", "pressure", "37.75"]
    assert [empty[name] for name in names] == [""] * 4
    (first, second) = track(bench, f"from={T_NS}&to={T_NS + SECOND}").poses
    assert (first.z, first.z_std_m, first.z_source, first.alt_m) == (3.25, 0.25, "pressure", 37.75)
    assert (second.z, second.z_std_m, second.z_source, second.alt_m) == (None,) * 4


def test_gpx_and_kml_leave_out_ambiguous_poses(tmp_path: Path) -> None:
    bench = driven(tmp_path, GEOREFERENCED)
    bench.now_ns = T_NS + SECOND
    bench.move("a", x=0.0, state=State.AMBIGUOUS)
    bench.write_history()
    text = ask(bench.app(), "GET", "/api/v1/tags/a/track?format=gpx").text
    assert text.count("<trkpt") == SECONDS + 1
    kml = ask(bench.app(), "GET", "/api/v1/tags/a/track?format=kml").text
    assert kml.count("<when>") == SECONDS + 1


@pytest.mark.parametrize(
    "query", ["from=2&to=1", "limit=0", "limit=10001", "from=-1", "cursor=x", "format=shp", "form=csv", "from=0"]
)
def test_invalid_track_parameters_are_refused(tmp_path: Path, query: str) -> None:
    assert kind_of(ask(driven(tmp_path).app(), "GET", f"/api/v1/tags/a/track?{query}")) == "invalid-request"


def pose_at(bench: ApiBench, offset_s: float) -> Pose:
    response = ask(bench.app(), "GET", f"/api/v1/tags/a/pose?at={T_NS + round(offset_s * SECOND)}")
    assert response.status_code == 200, response.text
    return Pose.model_validate(response.json())


def test_a_stored_pose_is_interpolated_and_its_covariance_grows_between_its_neighbours(
    tmp_path: Path,
) -> None:
    bench = driven(tmp_path)
    exact, between = pose_at(bench, -300.0), pose_at(bench, -299.5)
    assert (exact.x, between.x) == (600.0, 601.0)
    assert exact.covariance is not None
    assert between.covariance is not None
    assert exact.covariance[0][0] == pytest.approx(0.04)
    assert between.covariance[0][0] == pytest.approx(0.04 + 0.125**2)  # 1 m/s² over half a gap of 1 s
    assert (between.anchor, between.age_s, between.hypotheses) == ("17", 299.5, [])


def test_a_past_pose_is_refused_where_no_stored_pose_is_near(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    bench.now_ns = T_NS + 60 * SECOND
    bench.move("a", x=1200.0)
    bench.write_history()
    for offset_s in (-SECONDS - 1.0, 30.0):
        response = ask(bench.app(), "GET", f"/api/v1/tags/a/pose?at={T_NS + round(offset_s * SECOND)}")
        assert kind_of(response) == "no-pose-then", response.text
    assert kind_of(ask(bench.app(), "GET", f"/api/v1/tags/b/pose?at={T_NS}")) == "unknown-tag"


def test_memory_and_history_meet_without_a_gap(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    for tenth in range(5, 60):
        bench.now_ns = T_NS + tenth * SECOND // 10
        bench.move("a", x=1200.0 + 0.2 * tenth, speed=2.0, sigma_pos=0.2)  # not written yet
    assert pose_at(bench, 0.25).x == pytest.approx(1200.5)
    assert pose_at(bench, 5.05).x == pytest.approx(1210.1)


def test_a_page_that_wants_parquet_page_by_page_is_told_where_it_is() -> None:
    refused = ask(make_api_bench().app(), "GET", "/api/v1/tags/a/track?format=parquet")
    assert refused.status_code == 422
    assert "/track/file?format=parquet" in refused.json()["detail"]
    assert "pip install 'dropanchor-service[parquet]'" in refused.json()["detail"]
