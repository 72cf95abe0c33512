"""From the messages of a tag in a lift to the height of its pose, with the engine of the service."""

import math
from typing import Any

import numpy as np
import pytest

from dropanchor_schemas.kinds import ImuSample, PressureSample, RangeSample
from dropanchor_schemas.plans import Floor
from dropanchor_schemas.site import TagSettings
from dropanchor_schemas.wire import Frame
from dropanchor_service.answers.answers import Answers
from dropanchor_service.answers.hints import HEIGHT_UNTOLD
from dropanchor_service.estimation.fleet.engine import FleetEngine
from dropanchor_service.store import Tag
from dropanchor_service.store.floors import floors_of
from support.ingest import IngestBench
from support.manual_clock import ManualClock

T = 1_760_000_000_000_000_000
AWAY, TOLD = 10.0, 1.0  # m, horizontally from the anchor, and above it


def height(t_s: float) -> float:
    return TOLD + min(max(t_s - 4.0, 0.0), 5.0)


def tenth(t_s: float, rng: np.random.Generator, jump_pa: float) -> Frame:
    """Return what a tag in a lift sends in a tenth of a second."""
    t_ns, z = T + round(t_s * 1e9), height(t_s)
    noise = rng.standard_normal((10, 6)) * 0.02
    imu = [ImuSample(t_ns + k * 10_000_000, (n[0], n[1], 9.81 + n[2]), tuple(n[3:] / 10)) for k, n in enumerate(noise)]
    pressure = 101_325.0 * math.exp(-z / (29.2713 * 288.15)) + jump_pa
    return Frame(
        imu, [RangeSample(t_ns, 1, math.hypot(AWAY, z), 0.1)], pressures=[PressureSample(t_ns, pressure, 15.0)]
    )


class Lift:
    """A service that one tag in a lift sends to. In its house the tag rides from the ground to the first floor."""

    def __init__(self, **told: Any) -> None:
        tags = {"cart": {"start": {"x": AWAY, "y": 0.0, "heading_rad": 0.0}} | told}
        self.clock = ManualClock()
        site = {"anchors": [{"id": "1"}]}
        self.bench = IngestBench(engine=FleetEngine(), clock=self.clock, site=site, tags=tags)
        ends = {"Ground": (-1.0, 3.0), "1st": (3.0, 9.0)}
        self.bench.site.floors = floors_of(Floor(name=name, bottom_m=a, top_m=b) for name, (a, b) in ends.items())

    def ride(self, since_s: float = 0.0, until_s: float = 12.0, slams: bool = False) -> "Lift":
        rng = np.random.default_rng(1)
        for t_s in np.arange(since_s, until_s, 0.1).tolist():
            self.clock.t_ns = T + round(t_s * 1e9)
            self.bench.send("cart", tenth(t_s, rng, 200.0 if slams and 10.45 < t_s < 10.95 else 0.0))
        return self

    @property
    def tag(self) -> Tag:
        found = self.bench.tags.find("cart")
        assert found is not None
        return found

    def pose(self) -> dict[str, Any]:
        answers = Answers(self.bench.site, self.bench.tags, self.bench.latest, now_ns=lambda: self.clock.t_ns)
        pose = answers.pose_of(self.tag)
        assert pose is not None
        return pose


@pytest.mark.parametrize("slams", [False, True])
def test_the_pose_of_a_tag_in_a_lift_has_the_height_of_its_barometer(slams: bool) -> None:
    lift = Lift(height_m=TOLD).ride(slams=slams)
    pose, tag = lift.pose(), lift.tag
    assert (pose["z"], pose["z_source"]) == (pytest.approx(TOLD + 5.0, abs=0.2), "pressure")
    assert 0.05 < pose["z_std_m"] < 0.6
    assert math.hypot(pose["x"] - AWAY, pose["y"]) < 0.5
    assert tag.rejected == ({"pressure_doubted": 5} if slams else {})


def test_no_floor_is_named_and_a_hint_says_what_to_do_where_nobody_told_the_height_of_the_start() -> None:
    pose = Lift().ride().pose()
    assert (pose["z"], pose["z_source"]) == (pytest.approx(5.0, abs=0.2), "start")
    assert (pose["floor"], math.isnan(pose["floor_probability"])) == (None, True)
    assert pose["hint"] == HEIGHT_UNTOLD


@pytest.mark.parametrize("told", [{"height_m": TOLD}, {"height_told": True}], ids=["1 m", "0 m"])
def test_a_floor_is_named_where_the_height_of_the_start_is_told_also_if_it_is_0(told: dict[str, Any]) -> None:
    pose = Lift(**told).ride().pose()
    assert (pose["z_source"], pose["floor"], pose["hint"]) == ("pressure", "1st", "")
    assert pose["floor_probability"] > 0.99


def test_a_height_of_0_that_is_told_later_gives_the_floor_without_a_restart() -> None:
    lift = Lift().ride(until_s=11.0)
    lift.bench.site.set_tag("cart", lift.bench.site.tag_settings("cart").model_copy(update={"height_told": True}))
    pose = lift.ride(since_s=11.0).pose()
    assert (pose["floor"], pose["z"]) == ("1st", pytest.approx(5.0, abs=0.2))


def test_no_floor_is_named_after_a_restart_somewhere_in_the_house() -> None:
    lift = Lift(height_m=TOLD).ride(until_s=11.0)
    lift.bench.guarded_engine.restart(lift.tag.row)
    pose = lift.ride(since_s=11.0, until_s=20.0).pose()
    assert (pose["z_source"], pose["floor"]) == ("start", None)


@pytest.mark.parametrize(
    ("settings", "tells"),
    [
        ({}, False),
        ({"height_m": 1.5}, True),
        ({"height_told": True}, True),
        ({"height_m": 1.5, "height_told": False}, False),
    ],
)
def test_settings_tell_a_height_unless_it_is_0_or_they_say_otherwise(settings: dict[str, Any], tells: bool) -> None:
    assert TagSettings(**settings).tells_height is tells
