"""Tag settings that the operators of the recordings could have known, and where a simpler filter is nearer, why."""

import math

from dropanchor_service.estimation.columns import Array
from dropanchor_service.offline.plaza import PLAZA_SCALE, PLAZA_STD

TOP_SPEED_MPS = {
    "iasl": 1.5,
    "tiers": 0.7,
    "starloc": 2.5,
    "mower": 1.0,
    "plaza": 6.0,
    "hanyang": 3.0,
    "inrol": 1.0,
    "cf": 1.5,
}
ARM_M = 0.6

BEATEN = {
    "cf": "it flies in any direction within 2 m of its start; one range tells nothing of that, so a dot is nearest",
    "hanyang": "without an IMU only the ranges tell the speed: across the line of sight in nlosA2 it is taken for 0.3 "
    "instead of 0.7 m/s, and past an anchor at 5 m one track of losB4 ends 3 m off",
    "inrol": "it goes 0.2 m/s in a hand that turns, within 1.5 m of its start: a dot is nearest",
    "ipin": "the path is the better one (see ATE), but turned: how the device is held is not certain",
    "murp": "in 16_13 the anchor drives, which nobody told",
    "rtt": "ranges by Wi-Fi are metres off for seconds, and nobody told: tracks of 300 m and more on ways of 16 "
    "and 21 m, of which the fleet's spread widest",
}
"""Why a simpler filter is nearer to the truth, by family."""


def family_of(name: str) -> str:
    """Return the family of a recording: sequences of one kind."""
    return name.split("_")[0].rstrip("0123456789")


def apply_operator_knowledge(name: str, settings: Array) -> None:
    """Set what the operator knows in TAG_SETTINGS (0-d). An unknown recording changes nothing."""
    family = family_of(name)
    if family in TOP_SPEED_MPS:
        settings["speed_max"] = TOP_SPEED_MPS[family]
    if family == "plaza":
        settings["range_scale"], settings["range_std"] = PLAZA_SCALE, PLAZA_STD
    elif family == "hanyang":  # its heading is the direction of travel, made from the truth
        settings["heading_std"] = settings["slip_std"] = settings["mount_angle"] = settings["mount_angle_std"] = 0.0
    elif family == "starloc":  # the rig is held out in front with both hands
        settings["lever_x"] = ARM_M
    elif family == "inrol":  # carried sideways, by hand
        settings["mount_angle"], settings["mount_angle_std"], settings["slip_std"] = -math.pi / 2, 0.3, 0.3
    elif family == "cf":  # it flies in any direction about its body
        settings["slip_std"] = 3.0
    elif family == "mower":  # the IMU is mounted along its wheels
        settings["mount_angle"] = 0.0
