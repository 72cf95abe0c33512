"""Tag settings that the operators of the recordings could have known, and the results of a prototype."""

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
PROTOTYPE = {
    "iasl_s1": (0.79, 1.32),
    "iasl_s3": (0.82, 1.15),
    "starloc_fast_s1_tag1": (0.86, 2.10),
    "starloc_fast_s1_tag2": (0.78, 1.58),
    "mower": (1.20, 1.33),
    "tiers_B": (1.03, 1.03),
    "tiers_D": (0.20, 0.20),
    "plaza2": (6.9, 12.1),
    "hanyang_losB4": (0.77, 1.32),
    "hanyang_nlosA2": (0.48, 0.50),
}
"""RMSE, m, of the median and the worst anchor: a Gaussian-sum filter with parameters searched on these recordings."""


BEATEN = {
    "cf": "it flies in any direction within 2 m of its start; one range tells nothing of that, so a dot is nearest",
    "hanyang": "without an IMU the engine lets the speed jump, and drifts across the line of sight; an EKF takes the "
    "speed for even, as it is here",
    "inrol": "it goes 0.2 m/s in a hand that turns, within 1.5 m of its start: a dot is nearest",
    "ipin": "the path is the better one (see ATE), but turned: how the device is held is not certain",
    "murp": "in 16_13 the anchor drives, which nobody told",
    "rtt": "ranges by Wi-Fi are metres off for seconds, and nobody told; an EKF that knows little moves little",
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
