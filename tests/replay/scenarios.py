"""The runs of the golden replays: how each is simulated, and what the operator has said about the tag."""

import math
from dataclasses import dataclass, field
from typing import Literal

from dropanchor_tag_client.simulator.imu import ImuModel
from dropanchor_tag_client.simulator.perturbations import perturbed
from dropanchor_tag_client.simulator.ranging import AnchorPlace, RangeModel
from dropanchor_tag_client.simulator.scalar import ScalarModel
from dropanchor_tag_client.simulator.sensors import SensorModels

Feed = Literal["heading", "level", "raw9", "raw6"]
"""What the tag sends beside its ranges: headings of its platform; these and a level 6-axis IMU; or a raw IMU alone."""

RANGE_HZ, IMU_HZ = 10.0, 50.0
SENSORS = SensorModels(
    ranges=RangeModel(hz=RANGE_HZ, std=0.1), scalar=ScalarModel(heading_std=0.05), imu=ImuModel(hz=IMU_HZ)
)
TWO_ANCHORS = (AnchorPlace("0"), AnchorPlace("1", 8.0, -3.0, 2.0))


@dataclass(frozen=True)
class Scenario:
    """One run of one tag.

    motion, seed: of the simulator. silent_s: from when to when the tag sends nothing. bearings: whether anchor 0 also
    measures the bearing of the tag, once a second. start_known: whether the operator gave the start.
    """

    motion: str
    seed: int
    feed: Feed
    models: SensorModels = field(default_factory=lambda: SENSORS)
    duration_s: float = 30.0
    silent_s: tuple[float, float] = (math.inf, math.inf)
    bearings: bool = False
    start_known: bool = True
    reverse_allowed: bool = False


SCENARIOS = {
    "straight": Scenario("L1", 3, "heading"),
    "turns": Scenario("M5", 4, "level"),
    "stop_and_go": Scenario("SG", 5, "level"),
    "reverse": Scenario("RV", 6, "level", reverse_allowed=True),
    "unknown_start": Scenario("M5", 7, "raw9", start_known=False),
    "nlos": Scenario("S5", 8, "level", perturbed(SENSORS, "nlosburst")),
    "gap": Scenario("S5", 9, "raw9", silent_s=(14.0, 18.0)),
    "two_anchors": Scenario(
        "C5",
        10,
        "level",
        SensorModels(
            SENSORS.ranges,
            SENSORS.scalar,
            SENSORS.imu,
            anchors=TWO_ANCHORS,
            height_m=1.2,
            mount_rad=0.3,
        ),
        bearings=True,
    ),
    "raw_9_axis": Scenario("OU", 11, "raw9", perturbed(SENSORS, "magdist")),
    "raw_6_axis": Scenario("OU", 12, "raw6"),
}
