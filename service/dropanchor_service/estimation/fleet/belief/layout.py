"""The state vector, the row of one tag, and the records that the belief works on.

Compiled code gets records of these dtypes. mypy cannot see their fields, so the aliases `Row`, `Hypothesis`, … say
which record a function takes; the dtype of the same name lists its fields with units and shapes.
"""

from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

# State of one hypothesis, polar around the primary anchor.
R: Final = 0  # m, horizontal distance
PHI: Final = 1  # rad, bearing of the tag seen from the anchor
YAW: Final = 2  # rad, body yaw in the site frame
V: Final = 3  # m/s along the course
MOUNT: Final = 4  # rad, course minus body yaw, constant part: the mounting angle
SLIP: Final = 5  # rad, course minus body yaw, Gauss-Markov part
GYRO_BIAS: Final = 6  # rad/s, residual bias of the yaw increments
ACC_BIAS: Final = 7  # m/s^2, bias of the forward acceleration
REFERENCE: Final = 8  # rad, error of the heading reference
RANGE_BIAS: Final = 9  # m, bias of ranges to the primary anchor, as measured
LEFT_BIAS: Final = 10  # m/s^2, bias of the leftward acceleration
GAIT_OFFSET: Final = ACC_BIAS  # rad, of a carried tag, instead of accelerations: direction of its steps - course
STEP_SCALE: Final = LEFT_BIAS  # of a carried tag: log of the speed that its steps give over its speed
N: Final = 11
PACKED: Final = N * (N + 1) // 2  # entries of the upper triangle of a covariance

WORKING_HYPOTHESES: Final = 320  # at most, of one row while it is being worked on
MAX_HYPOTHESES: Final = 192  # at most, of one row between batches
START_RANGES: Final = 15  # of which the median gives the distance of an unknown start
FIX_SLOTS: Final = 4  # anchors whose ranges tell a place at once
NOISE_LEVELS: Final = 6  # of errors of ranges that last
STUCK_SLOTS: Final = 4  # anchors of a row whose last ranges are kept; those of equal remainder share a slot

# Models of the error of the heading reference (`heading_models`). The first MODELS are judged by their predictions.
MODELS: Final = 2  # an error that is white, and one that wanders for seconds
MAGNETOMETER_MODEL: Final = 2  # given by the kind of heading: almost all of the variance is one slow error
PLATFORM_MODEL: Final = 3  # given by the kind of heading: a platform's own, which is stable or drifts

# Classes of hypotheses: what is wrong with the heading.
EXACT: Final = 0  # no more than the heading model says
OWN_ERROR: Final = 1  # the heading reference has a slow error of its own, or drifts
CLASSES: Final = 2
FAMILIES: Final = 2 * CLASSES  # each of them: mounted about as the best guess, and quite otherwise

SETTINGS: Final = np.dtype(
    [
        ("mount_angle", np.float64),  # rad
        ("mount_angle_std", np.float64),
        ("lever_x", np.float64),  # m, from the point that follows the course to the tag, body frame
        ("lever_y", np.float64),
        ("slip_std", np.float64),  # rad
        ("slip_tau", np.float64),  # s
        ("slip_given", np.uint8),  # 1: the operator gave slip_std
        ("height", np.float64),  # m, tag antenna above the site's zero: as told, or of the last node
        ("height_std", np.float64),
        ("height_source", np.uint8),  # TOLD, BY_PRESSURE or UNKNOWN
        ("range_std", np.float64),  # m, of a measured range
        ("range_std_given", np.uint8),  # 1: the operator gave it
        ("range_scale", np.float64),  # measured = scale * distance + bias
        ("range_bias", np.float64),  # m
        ("range_bias_std", np.float64),
        ("reference_std", np.float64),  # rad, constant error of north, with that of the declination
        ("gyro_bias_std", np.float64),  # rad/s, residual bias of the yaw increments
        ("speed_max", np.float64),  # m/s
        ("reverse_allowed", np.uint8),
        ("heading_source", np.uint8),
        ("heading_std", np.float64),  # rad, of a platform's heading that does not drift, or of north; NaN: not known
    ]
)

START: Final = np.dtype(
    [
        ("known", np.uint8),
        ("x", np.float64),  # m
        ("y", np.float64),
        ("std", np.float64),
        ("heading", np.float64),  # rad, body yaw; NaN: unknown
        ("heading_std", np.float64),
        ("speed_std", np.float64),  # m/s
        ("other_x", np.float64),  # m, where it may start as well; NaN: nowhere, or one place is left
        ("other_y", np.float64),
        ("after_gap", np.uint8),  # 1: the start is where the tag was before a gap
        ("coarse", np.uint8),  # 1: it begins again after a gap, with few and wide hypotheses until one is resolved
        ("range_count", np.int32),
        ("ranges", np.float64, (START_RANGES,)),  # m, the last ones as distances
        ("collected_s", np.float64),  # s over which they were collected
        ("way", np.float64),  # m, driven since the start
        ("free", np.uint8),  # 1: it started where ranges to three anchors say, without any heading
        ("fix_run", np.uint8),  # how many of these ranges in a row contradict each other or the track
        ("contradicted_ns", np.int64),  # when a long run of them last contradicted each other; 0: never
        ("fix_anchor", np.int32, (FIX_SLOTS,)),  # the last range to each of the last anchors, and when it came
        ("fix_z", np.float64, (FIX_SLOTS,)),  # m
        ("fix_t_ns", np.int64, (FIX_SLOTS,)),  # 0: none
    ]
)

HEADING: Final = np.dtype(
    [
        ("model", np.uint8),  # of the error of the reference in use
        ("north", np.float64),  # rad, constant error of the reference, learned from a given start heading
        ("slow_var", np.float64),  # rad^2, of the slow error of a magnetometer at the node before; 0: none
        ("in_site_frame", np.uint8),  # 1: yaw counts from east; 0: the x axis is the first direction of travel
        ("models_started", np.uint8),
        ("model_mean", np.float64, (MODELS, 3)),  # yaw rad, gyroscope bias rad/s, slow error rad
        ("model_cov", np.float64, (MODELS, 3, 3)),
        ("model_log_likelihood", np.float64, (MODELS,)),
    ]
)

NLOS: Final = np.dtype(
    [
        ("high_run", np.int32),  # innovations in a row that were far too large
        ("low_run", np.int32),  # and far too small
        ("misfit", np.float64),  # exponential mean of the outlier probability that the best hypothesis gave
        ("misfit_s", np.float64),  # s for which most ranges have been outliers
        ("widened", np.int32),  # how often the track was widened since the ranges last agreed with it
        ("since_los_offer_s", np.float64),  # s since NLOS hypotheses were last offered a clear line of sight
    ]
)

NOISE: Final = np.dtype(
    [
        ("white_var", np.float64),  # m^2, of what is new in every range; 0: not started
        ("told", np.uint8),  # 1: the operator or the first range said how much ranges scatter
        ("count", np.float64),  # ranges that white_var was learned from
        ("z", np.float64, (2,)),  # m, the last two ranges to the primary anchor, and when they came
        ("t_ns", np.int64, (2,)),
        ("log_p", np.float64, (NOISE_LEVELS,)),  # of the levels of errors that last
        ("factor", np.float64),  # by which the variance of a range is larger than white_var
        ("peak", np.float64),  # largest factor lately
        ("lasting_var", np.float64),  # m^2, of the errors that last
        ("block_s", np.float64),  # s of the block of ranges that is being added up
        ("block_ranges", np.int32),  # how many they are
        ("error", np.float64),  # m, sum of its innovations
        ("spread", np.float64),  # m^2, sum of their variances without that of the ranges
        ("white", np.float64),  # m^2, sum of white_var
    ]
)

GAP: Final = np.dtype(
    [
        ("unobserved_s", np.float64),  # s of motion that no sensor observed; 0: there is no gap
        ("x", np.float64),  # m, from the anchor, of the tag before the gap
        ("y", np.float64),
        ("var", np.float64),  # m^2
        ("speed", np.float64),  # m/s
        ("course", np.float64),  # rad
        ("yaw", np.float64),  # rad, with the turns that were observed since
        ("yaw_var", np.float64),  # rad^2, before the gap
        ("turn_s", np.float64),  # s of turns that were not observed
        ("observed_s", np.float64),  # s since the samples came back
        ("relative", np.uint8),  # 1: x, y, course and yaw are in the frame of the tag's own
        ("fragments", np.uint8),  # short stretches of samples between gaps since the track was lost
    ]
)

WALK: Final = np.dtype(
    [
        ("carried", np.uint8),  # 1: the hypotheses are those of a carried tag
        ("x", np.float64),  # m, from the anchor, where the tag was before the last steps
        ("y", np.float64),
        ("var", np.float64),  # m^2; 0: not known
    ]
)

MOUNTING: Final = np.dtype(
    [
        ("rigid", np.uint8),  # 1: nothing speaks for a loose mount
        ("rigid_log_odds", np.float64),
        ("lateral_misfit", np.float64),  # mean square of the sideways innovation of a rigid mount, in its variance
        ("lateral_along", np.float64),  # the same of its derivative by the mounting angle, 1/rad^2
        ("lateral_cross", np.float64),  # mean product of the two, 1/rad
        ("slid", np.float64),  # m/s, sum of these innovations over a second, see `sliding`
        ("slid_std", np.float64),  # m/s, of what is the same in each of them
        ("slid_var", np.float64),  # (m/s)^2, of the rest
        ("sliding", np.float64),  # mean square of the sum, in its variance
    ]
)

PUBLICATION: Final = np.dtype(
    [
        ("state", np.uint8),
        ("reason", np.uint8),
        ("resolved", np.uint8),  # 1: one mode has explained all ranges for long enough
        ("resolved_s", np.float64),  # s for which one mode has been dominant and small
        ("unresolved_s", np.float64),  # s for which none has been dominant
        ("x", np.float64),  # m, from the anchor, of the mode that was published last
        ("y", np.float64),
        ("information", np.float64, (3, 3)),  # of recent ranges on (x, y, speed)
    ]
)

STUCK: Final = np.dtype(
    [
        ("anchor", np.int32, (STUCK_SLOTS,)),  # of each slot: the last range, how often it came and since when
        ("z", np.float64, (STUCK_SLOTS,)),  # m
        ("count", np.int32, (STUCK_SLOTS,)),
        ("t_ns", np.int64, (STUCK_SLOTS,)),
    ]
)

ROW: Final = np.dtype(
    [
        ("settings", SETTINGS),
        ("start", START),
        ("heading", HEADING),
        ("nlos", NLOS),
        ("noise", NOISE),
        ("gap", GAP),
        ("publication", PUBLICATION),
        ("stuck", STUCK),
        ("walk", WALK),
        ("mount", MOUNTING),
        ("first_slot", np.int32),  # of this row in the pool, -1: none
        ("count", np.int32),  # hypotheses
        ("t_ns", np.int64),
        ("anchor", np.int32),  # the primary anchor, -1: no range yet
        ("faults", np.uint8),  # how often the numbers were not finite
        ("since_reduction_s", np.float64),  # s since the mixture was last merged and split
        ("since_range_s", np.float64),
        ("stood_s", np.float64),  # s of rest until now
        ("since_turnabout_s", np.float64),  # s since a tag that reversed was last offered to drive ahead
        ("quiet_share", np.float64),  # share of the time in certain motion in which the IMU looked like rest
        ("since_class_check_s", np.float64),
        ("lever_rate", np.float64),  # rad/s, mean yaw rate of the last node
    ],
    align=True,
)

POOL_SLOT: Final = np.dtype(
    [
        ("next", np.int32),
        ("heading_class", np.int32),  # EXACT or OWN_ERROR
        ("nlos", np.int32),  # 1: there is no line of sight now, so ranges are too long
        ("reverse", np.int32),  # 1: the tag moves backwards since it last stood
        ("free", np.int32),  # in the head of a free list: how many slots it has
        ("log_weight", np.float64),
        ("los_bias", np.float64),  # m, range bias before the line of sight was lost
        ("los_bias_var", np.float64),  # m^2
        ("mean", np.float64, (N,)),
        ("cov", np.float64, (PACKED,)),
    ]
)

BELIEF: Final = np.dtype(
    [
        *((name, np.float64) for name in ("x", "y", "z", "z_std")),  # m
        ("course", np.float64),
        ("yaw", np.float64),
        ("speed", np.float64),
        ("yaw_rate", np.float64),
        ("cov", np.float64, (3, 3)),  # of x, y, course
        ("p_mode", np.float64),
        ("sigma_pos", np.float64),
        ("sigma_obs", np.float64),
        ("parts", np.float64, (6,)),  # of sigma_pos, in the order of `parts`
        ("innovation", np.float64),  # of the likeliest hypothesis, in the units of the measurement
        ("innovation_variance", np.float64),  # 0: no measurement met a belief
        ("p_outlier", np.float64),
        ("white_std", np.float64),  # m, of what is new in every range; 0: the measurement was none
        ("lasting_std", np.float64),  # m, of the errors of ranges that last
        ("stuck", np.bool_),  # the range is one that a stuck radio repeats
        ("hypotheses", np.int32),
        ("state", np.uint8),
        ("reason", np.uint8),
        ("relative", np.uint8),  # 1: x, y, course and yaw are in a frame of the tag's own
    ]
)

Floats: TypeAlias = npt.NDArray[np.float64]
Row: TypeAlias = Any  # a record of ROW
Hypothesis: TypeAlias = Any  # a record of WORKING_HYPOTHESIS
Hypotheses: TypeAlias = Any  # (WORKING_HYPOTHESES,) of them, of which the first `count` are in use
Belief: TypeAlias = Any  # a record of BELIEF
Scratch: TypeAlias = Any  # a record of SCRATCH
Workspace: TypeAlias = Any  # a record of WORKSPACE
Anchor: TypeAlias = Any  # a record of ANCHOR
Rows: TypeAlias = npt.NDArray[np.void]  # ROW (n,)
Pool: TypeAlias = npt.NDArray[np.void]  # POOL_SLOT (n,)
Beliefs: TypeAlias = npt.NDArray[np.void]  # BELIEF (n,)
Anchors: TypeAlias = npt.NDArray[np.void]  # ANCHOR (n,)
