"""From the messages of a tag in a lift to the height of its pose, with the engine of the service."""

import math

import numpy as np
import pytest

from dropanchor_schemas.kinds import ImuSample, PressureSample, RangeSample
from dropanchor_schemas.wire import Frame
from dropanchor_service.answers.answers import Answers
from dropanchor_service.estimation.fleet.engine import FleetEngine
from support.ingest import IngestBench

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


@pytest.mark.parametrize("slams", [False, True])
def test_the_pose_of_a_tag_in_a_lift_has_the_height_of_its_barometer(slams: bool) -> None:
    start = {"x": AWAY, "y": 0.0, "heading_rad": 0.0}
    tags = {"cart": {"height_m": TOLD, "start": start}}
    bench, rng = IngestBench(engine=FleetEngine(), site={"anchors": [{"id": "1"}]}, tags=tags), np.random.default_rng(1)
    for t_s in np.arange(0.0, 12.0, 0.1).tolist():
        bench.send("cart", tenth(t_s, rng, 200.0 if slams and 10.45 < t_s < 10.95 else 0.0))
    tag = bench.tags.find("cart")
    assert tag is not None
    pose = Answers(bench.site, bench.tags, bench.latest).pose_of(tag)
    assert pose is not None
    assert (pose["z"], pose["z_source"]) == (pytest.approx(TOLD + 5.0, abs=0.2), "pressure")
    assert 0.05 < pose["z_std_m"] < 0.6
    assert math.hypot(pose["x"] - AWAY, pose["y"]) < 0.5
    assert tag.rejected == ({"pressure_doubted": 5} if slams else {})
