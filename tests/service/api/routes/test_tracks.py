"""Tracks of many tags over REST: figures, points, and a file with every pose."""

import csv
import io
import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dropanchor_schemas.track import Track
from dropanchor_schemas.tracks import Tracks
from dropanchor_service.api.routes import track_file
from dropanchor_service.estimation.columns import Frame, State
from service.api.routes.test_track import GEOREFERENCED, RETENTION, SECOND, SECONDS, driven
from support.api import T_NS, ApiBench, ask, kind_of, make_api_bench


def tracks(bench: ApiBench, query: str = "") -> Tracks:
    response = ask(bench.app(), "GET", f"/api/v1/tracks?{query}")
    assert response.status_code == 200, response.text
    return Tracks.model_validate(response.json())


def test_figures_and_points_of_each_tag(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    bench.move("b", x=1.0, state=State.AMBIGUOUS, speed=9.0)
    bench.write_history()
    first, second = tracks(bench).tracks
    assert (first.tag, first.poses, first.distance_m, first.tracked_s) == ("a", SECONDS + 1, 1200, 600)
    assert (first.mean_speed_mps, first.max_speed_mps) == (2, 2)
    assert (second.tag, second.tracked_s, second.mean_speed_mps, second.max_speed_mps) == ("b", 0, None, None)
    points = first.points
    assert 100 < len(points.t_ns) <= 300
    assert (points.t_ns[0], points.t_ns[-1]) == (T_NS - SECONDS * SECOND, T_NS)
    assert points.x[-1] == 1200
    assert points.since_previous == ["unknown", *["tracking"] * (len(points.t_ns) - 1)]
    assert points.semi_major_m[0] == pytest.approx(0.2 * 2.4477, rel=1e-3)
    assert points.sigma_pos_m[0] == pytest.approx(0.2)
    assert second.points.state == ["ambiguous"]


def test_a_point_in_a_frame_of_its_own_says_so(tmp_path: Path) -> None:
    bench = make_api_bench(folder=tmp_path, retention=RETENTION)
    bench.move("a", frame=Frame.RELATIVE)
    bench.write_history()
    (track,) = tracks(bench, f"from={T_NS}&to={T_NS}").tracks
    assert (track.points.frame, track.points.state, track.tracked_s) == (["relative"], ["relative"], 0)


def test_a_period_can_be_given_as_iso_8601(tmp_path: Path) -> None:
    (track,) = tracks(driven(tmp_path), "from=2027-01-15T07:59:00Z&to=2027-01-15T08:00:00Z").tracks
    assert track.poses == 61


def test_a_period_tags_and_the_number_of_points_can_be_chosen(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    (track,) = tracks(bench, f"from={T_NS - 100 * SECOND}&to={T_NS - 50 * SECOND}&max_points=6&tags=a,x").tracks
    assert (track.poses, track.distance_m, len(track.points.t_ns)) == (51, 100, 3)
    assert tracks(bench, "tags=x").tracks == []


@pytest.mark.parametrize(
    "query", ["from=2&to=1", "max_points=1", "max_points=5001", "from=-1", "tags=", "points=3", "from=0"]
)
def test_invalid_parameters_are_refused(tmp_path: Path, query: str) -> None:
    assert kind_of(ask(driven(tmp_path).app(), "GET", f"/api/v1/tracks?{query}")) == "invalid-request"


def exported(bench: ApiBench, form: str) -> str:
    response = ask(bench.app(), "GET", f"/api/v1/tags/a/track/file?format={form}")
    assert response.status_code == 200, response.text
    assert response.headers["content-disposition"] == f"attachment; filename*=UTF-8''a.{form}"
    return response.text


@pytest.mark.parametrize("size", [10_000, 250, 601, 600])
def test_a_file_holds_every_pose_once_however_many_pages_that_takes(
    tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = driven(tmp_path, GEOREFERENCED)
    monkeypatch.setattr(track_file, "PAGE", size)
    expected = [T_NS - second * SECOND for second in range(SECONDS, -1, -1)]
    rows = list(csv.DictReader(io.StringIO(exported(bench, "csv"))))
    assert [int(row["t_ns"]) for row in rows] == expected
    features = json.loads(exported(bench, "geojson"))["features"]
    assert [feature["properties"]["t_ns"] for feature in features] == expected
    assert [pose.t_ns for pose in Track.model_validate_json(exported(bench, "json")).poses] == expected
    gpx = ElementTree.fromstring(exported(bench, "gpx"))
    assert len(list(gpx.iter("{http://www.topografix.com/GPX/1/1}trkpt"))) == len(expected)
    assert len(list(gpx.iter("{http://www.topografix.com/GPX/1/1}trkseg"))) == 1
    whens = re.findall("<when>(.+?)</when>", exported(bench, "kml"))
    assert (sorted(whens), len(set(whens))) == (whens, len(expected))  # the last one of a page begins the next track


def parquet(bench: ApiBench, query: str = "") -> pq.ParquetFile:
    response = ask(bench.app(), "GET", f"/api/v1/tags/a/track/file?format=parquet{query}")
    assert (response.status_code, response.headers["content-type"]) == (200, "application/vnd.apache.parquet")
    assert response.headers["content-disposition"] == "attachment; filename*=UTF-8''a.parquet"
    return pq.ParquetFile(io.BytesIO(response.content))


def test_a_parquet_file_holds_every_pose_in_row_groups_with_units_and_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = driven(tmp_path, GEOREFERENCED)
    monkeypatch.setattr(track_file, "PAGE", 100)
    monkeypatch.setattr("dropanchor_service.api.formats.parquet.GROUP_ROWS", 250)
    file = parquet(bench)
    rows = file.read().to_pylist()
    csv_rows = list(csv.DictReader(io.StringIO(exported(bench, "csv"))))
    assert [file.metadata.row_group(group).num_rows for group in range(file.num_row_groups)] == [300, 300, 1]
    types = [file.schema_arrow.field(name).type for name in ("t_ns", "t_utc", "lat")]
    assert types == [pa.int64(), pa.timestamp("ns", "UTC"), pa.float64()]
    assert [row["t_ns"] for row in rows] == [int(row["t_ns"]) for row in csv_rows]
    assert [value.value for value in file.read(["t_utc"])["t_utc"]] == [row["t_ns"] for row in rows]
    for name in set(csv_rows[0]) - {"t_ns", "t_utc"}:
        texts = [row[name] for row in csv_rows]
        numbers = isinstance(rows[0][name], float)
        unknown = [None if text == "" else text for text in texts]
        whole = [str(row[name]) if name == "epoch" else row[name] for row in rows]
        assert whole == (pytest.approx([float(text) for text in texts]) if numbers else unknown)
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in file.schema_arrow}
    assert (units["x"], units["heading_rad"], units["cov_xh"], units["state"]) == ("m", "rad", "m·rad", "")
    about = file.schema_arrow.metadata
    assert (about[b"dropanchor.tag"], about[b"dropanchor.site"]) == (b"a", b"default")
    assert json.loads(about[b"dropanchor.georeference"]) == {
        "lat": 52.5,
        "lon": 13.4,
        "rotation_rad": 0.0,
        "alt_m": None,
    }
    assert b"counter-clockwise" in about[b"dropanchor.frame"]


def test_unknown_numbers_are_null_in_parquet_and_no_poses_are_no_rows(tmp_path: Path) -> None:
    bench = make_api_bench(folder=tmp_path, retention=RETENTION)
    bench.move("a", x=np.nan, cov=np.nan)
    bench.write_history()
    file = parquet(bench, f"&from={T_NS}&to={T_NS}")
    (row,) = file.read().to_pylist()
    assert (row["x"], row["var_x"], row["state"], row["y"]) == (None, None, "tracking", 0.0)
    assert "lat" not in row
    assert parquet(bench, "&from=0&to=1").metadata.num_rows == 0


def test_a_track_without_poses_is_an_empty_file(tmp_path: Path) -> None:
    bench = driven(tmp_path, GEOREFERENCED)
    for form in ("csv", "json", "geojson", "gpx", "kml"):
        response = ask(bench.app(), "GET", f"/api/v1/tags/a/track/file?format={form}&from=0&to=1")
        assert response.status_code == 200
        if "json" in form:
            assert response.json()["features" if form == "geojson" else "poses"] == []


@pytest.mark.parametrize("form", ["geojson", "gpx", "kml"])
def test_a_site_without_a_georeference_says_what_to_do(tmp_path: Path, form: str) -> None:
    refused = ask(driven(tmp_path).app(), "GET", f"/api/v1/tags/a/track/file?format={form}")
    assert kind_of(refused) == "not-georeferenced"
    assert "Set `georeference`" in refused.text


def test_a_file_of_an_unknown_tag_or_of_no_history_is_a_problem(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    assert kind_of(ask(bench.app(), "GET", "/api/v1/tags/nobody/track/file")) == "unknown-tag"
    assert kind_of(ask(make_api_bench().app(), "GET", "/api/v1/tags/a/track/file")) == "no-history"
    assert kind_of(ask(bench.app(), "GET", "/api/v1/tags/a/track/file?format=shp")) == "invalid-request"


def test_the_history_says_which_time_it_covers(tmp_path: Path) -> None:
    bench = make_api_bench(folder=tmp_path, retention=RETENTION)
    empty = {"enabled": True, "from_ns": None, "to_ns": None}
    assert ask(bench.app(), "GET", "/api/v1/history").json() == empty
    bench.write_history()
    assert ask(bench.app(), "GET", "/api/v1/history").json() == empty
    found = ask(driven(tmp_path).app(), "GET", "/api/v1/history").json()
    assert found == {"enabled": True, "from_ns": T_NS - 600 * SECOND, "to_ns": T_NS + 10 * SECOND}
    assert ask(make_api_bench().app(), "GET", "/api/v1/history").json() == empty | {"enabled": False}


def test_a_damaged_history_covers_no_time(tmp_path: Path) -> None:
    bench = driven(tmp_path)
    for file in tmp_path.glob("history.sqlite*"):
        file.write_bytes(b"torn " * 1000)
    assert kind_of(ask(bench.app(), "GET", "/api/v1/history")) == "history-unreadable"


def test_the_history_says_when_there_are_poses_and_when_not(tmp_path: Path) -> None:
    bench = make_api_bench(folder=tmp_path, retention=RETENTION)
    path = "/api/v1/history/coverage"
    empty = {"from_ns": None, "to_ns": None, "step_ns": 10 * SECOND}
    assert ask(bench.app(), "GET", path).json() == {**empty, "stretches": []}
    for seconds in (0, 10, 20, 500, 86_400):
        bench.move("a", x=1.0, t_ns=T_NS + seconds * SECOND)
    bench.write_history()
    found = ask(bench.app(), "GET", f"{path}?to={T_NS + 600 * SECOND}").json()
    assert found["step_ns"] == 10 * SECOND
    assert [[(t - T_NS) // SECOND for t in each.values()] for each in found["stretches"]] == [[0, 30], [500, 510]]
    whole = ask(bench.app(), "GET", f"{path}?max_parts=2&from=0").json()
    assert len(whole["stretches"]) == 1  # parts of many years
    assert whole["stretches"][0]["from_ns"] <= T_NS < whole["stretches"][0]["to_ns"]
    nothing = ask(bench.app(), "GET", f"{path}?from={T_NS - 900 * SECOND}&to={T_NS - 60 * SECOND}").json()
    assert nothing["stretches"] == []
    for query in (f"from={T_NS + 10**6 * SECOND}", f"to={T_NS - 60 * SECOND}"):  # after the last pose, before the first
        outside = ask(bench.app(), "GET", f"{path}?{query}").json()
        assert outside["stretches"] == []
        assert outside["from_ns"] == outside["to_ns"]
    for query in ("from=2&to=1", "max_parts=0", "max_parts=1001", "parts=3"):
        assert kind_of(ask(bench.app(), "GET", f"{path}?{query}")) == "invalid-request"
    assert kind_of(ask(make_api_bench().app(), "GET", path)) == "no-history"
    for file in tmp_path.glob("history.sqlite*"):
        file.write_bytes(b"torn " * 1000)
    assert kind_of(ask(bench.app(), "GET", path)) == "history-unreadable"
