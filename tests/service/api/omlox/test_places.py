"""Where omlox clients see tags, and when they see nothing."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_schemas.pose import TrackingState
from dropanchor_service.api.omlox.models import Location, TrackableMotion, Zone
from dropanchor_service.estimation.columns import Frame, HeightSource, State, StateReason
from support.omlox import BARE, YARD, OmloxBench

COV = np.diag([0.04, 0.01, 0.0004])


def test_a_tag_whose_place_is_known_has_a_location_in_degrees_or_metres() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1", x=20.0, y=-5.0, heading=0.5, speed=1.25, cov=COV)
    on_earth = bench.get("providers/tag-1/location")
    local = bench.get("providers/tag-1/location", crs="local")
    pose = bench.poses.answers.pose_of(bench.poses.answers.tags.register("tag-1"))
    assert pose is not None
    Location.model_validate(on_earth)
    assert on_earth["position"]["coordinates"] == pytest.approx([pose["lon"], pose["lat"]], abs=1e-9)
    assert (on_earth["crs"], local["crs"]) == ("EPSG:4326", "local")
    assert local["position"] == {"type": "Point", "coordinates": [20.0, -5.0, 0.0]}
    assert local["timestamp_generated"] == "2027-01-15T08:00:00.000Z"
    assert local["accuracy"] == pytest.approx(pose["ellipse_95"]["semi_major_m"], abs=1e-3)
    assert local["true_heading"] == pytest.approx((90 - math.degrees(0.5 + 0.3)) % 360, abs=0.01)
    assert local["heading_accuracy"] == pytest.approx(1.96 * math.degrees(0.02), abs=0.01)
    assert local["speed"] == 1.25
    assert local["trackables"] == [bench.id_of("tag-1")]
    properties = local["properties"]
    assert (properties["state"], properties["reason"], properties["frame"]) == ("tracking", "resolved", "site")
    assert properties["covariance"] == COV.tolist()


def test_a_location_has_the_height_in_the_frame_of_the_site_and_on_earth_where_the_altitude_is_known() -> None:
    assert YARD.georeference is not None
    on_a_hill = YARD.model_copy(update={"georeference": YARD.georeference.model_copy(update={"alt_m": 34.5})})
    for site, on_earth in ((on_a_hill, 37.75), (YARD, None)):
        bench = OmloxBench(site)
        bench.poses.move("tag-1", x=1.0, y=2.0, z=3.25, z_std=0.25, z_source=HeightSource.PRESSURE)
        local = Location.model_validate(bench.get("providers/tag-1/location", crs="local"))
        assert (local.position.coordinates, local.elevation_ref) == ([1.0, 2.0, 3.25], None)
        location = Location.model_validate(bench.get("providers/tag-1/location"))
        assert location.position.coordinates[2:] == ([] if on_earth is None else [on_earth])
        assert location.elevation_ref == (None if on_earth is None else "wgs84")


@pytest.mark.parametrize("heading", [math.nan])
def test_an_unknown_heading_is_negative(heading: float) -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1", heading=heading)
    location = bench.get("providers/tag-1/location")
    assert location["true_heading"] < 0
    assert "heading_accuracy" not in location


@pytest.mark.parametrize("state", list(TrackingState))
def test_only_a_tag_in_one_known_place_has_a_location(state: TrackingState) -> None:
    bench = OmloxBench()
    of_engine = {"frame": Frame.RELATIVE} if state == "relative" else {"state": State[state.name]}
    bench.poses.move("tag-1", reason=StateReason.UNCERTAIN, **of_engine)
    trackable = bench.id_of("tag-1")
    if state in ("tracking", "coasting", "degraded"):
        assert bench.get("providers/tag-1/location")["properties"]["state"] == state
        assert bench.get(f"trackables/{trackable}/motion")["location"]["properties"]["state"] == state
        return
    assert_no_place(bench, trackable, state)


def test_a_tag_in_a_frame_of_its_own_has_no_location() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1", frame=Frame.RELATIVE)
    properties = assert_no_place(bench, bench.id_of("tag-1"), "relative")
    assert properties["frame"] == "relative"


def test_a_silent_tag_loses_its_location() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1")
    bench.poses.now_ns += 11_000_000_000
    assert_no_place(bench, bench.id_of("tag-1"), "lost")


def test_a_tag_without_a_pose_is_initialising() -> None:
    bench = OmloxBench()
    bench.poses.answers.tags.register("tag-1")
    assert_no_place(bench, bench.id_of("tag-1"), "initialising")


def assert_no_place(bench: OmloxBench, trackable: str, state: str) -> dict[str, Any]:
    """Check that no answer shows a place of the only tag. Return what the service says about it."""
    for path in ("providers/tag-1/location", f"trackables/{trackable}/location", f"trackables/{trackable}/motion"):
        response = bench.ask("GET", path)
        assert response.status_code == 404
        assert response.json()["type"] == "urn:dropanchor:problem:no-location"
        assert response.json()["properties"]["tags"][0]["state"] == state
    for path in ("providers/locations", f"trackables/{trackable}/locations", "trackables/motions"):
        assert bench.get(path) == []
        assert bench.get(path, geojson="true")["features"] == []
    provider = bench.get("providers/tag-1")["properties"]["dropanchor"]
    assert provider["state"] == state
    assert bench.get(f"trackables/{trackable}")["properties"]["dropanchor"]["tags"] == [provider]
    return dict(provider)


def test_the_ground_control_points_of_a_zone_turn_local_coordinates_into_degrees() -> None:
    bench = OmloxBench()
    zones = [Zone.model_validate(zone) for zone in bench.get("zones/summary")]
    assert [zone.foreign_id for zone in zones] == ["17", "18"]
    for zone, (x, y) in zip(zones, [(12.0, -30.0), (70.0, 20.0)], strict=True):
        assert zone.ground_control_points is not None
        on_earth, local = np.array(zone.ground_control_points[::2]), np.array(zone.ground_control_points[1::2])
        affine, *_ = np.linalg.lstsq(np.column_stack([local, np.ones(4)]), on_earth, rcond=None)
        bench.poses.move("tag-1", x=x, y=y)
        shown = bench.get("providers/tag-1/location")["position"]["coordinates"]
        assert np.array([x, y, 1.0]) @ affine == pytest.approx(shown, abs=1e-8)  # a millimetre


def test_without_a_georeference_everything_is_local_and_degrees_are_refused() -> None:
    bench = OmloxBench(BARE)
    bench.poses.move("tag-1", x=7.0, y=8.0)
    location = bench.get("providers/tag-1/location")
    assert (location["crs"], location["position"]["coordinates"]) == ("local", [7.0, 8.0, 0.0])
    (zone,) = bench.get("zones/summary")
    assert zone["incomplete_configuration"] is True
    assert "ground_control_points" not in zone
    for query in ({"crs": "EPSG:4326"}, {"geojson": "true"}):
        assert bench.refusal("GET", "providers/tag-1/location", params=query)[0] == "not-georeferenced"


def test_geojson_holds_only_degrees() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1", x=7.0, y=8.0)
    plain, feature = (bench.get("providers/tag-1/location", **query) for query in ({}, {"geojson": "true"}))
    assert feature["geometry"] == plain.pop("position")
    assert feature["properties"] == plain
    motion = bench.get("trackables/motions", geojson="true")["features"][0]
    assert motion["geometry"] == feature["geometry"]
    refused = bench.refusal("GET", "providers/locations", params={"geojson": "true", "crs": "local"})
    assert refused[:2] == ("invalid-request", 400)


@pytest.mark.parametrize("query", [{"crs": "EPSG:3857"}, {"zone_id": "nowhere"}, {"geojson": "perhaps"}])
def test_a_wrong_parameter_is_an_error_with_code_400(query: dict[str, str]) -> None:
    assert OmloxBench().refusal("GET", "providers/locations", params=query)[:2] == ("invalid-request", 400)


def test_a_location_names_the_zone_of_the_anchor_that_the_tag_ranges_to() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1", anchor=1)
    zones = {zone["foreign_id"]: zone["id"] for zone in bench.get("zones/summary")}
    assert bench.get("providers/tag-1/location")["source"] == zones["18"]
    assert bench.get("zones", foreign_id="18") == [zones["18"]]
    assert bench.get(f"zones/{zones['18']}")["foreign_id"] == "18"
    assert bench.get("providers/locations", zone_id="18") == bench.get("providers/locations")
    assert bench.refusal("GET", f"zones/{bench.id_of('tag-1')}")[0] == "unknown-zone"


def test_older_clients_find_the_same_at_v1() -> None:
    bench = OmloxBench()
    bench.poses.move("tag-1")
    assert bench.ask("GET", "trackables/motions", "v1").json() == bench.get("trackables/motions")
    TrackableMotion.model_validate(bench.get("trackables/motions")[0])
