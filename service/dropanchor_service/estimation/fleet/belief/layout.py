"""Where things lie: the state vector, one row per tag, and the pool of hypothesis slots rows point into."""

from typing import Final

import numpy as np
import numpy.typing as npt

# State of one hypothesis, polar around the primary anchor.
R: Final = 0  # m, horizontal distance
PHI: Final = 1  # rad, bearing of the tag seen from the anchor
YAW: Final = 2  # rad, body yaw in the site frame
V: Final = 3  # m/s along the course
MOUNT: Final = 4  # rad, course minus body yaw, constant part
CRAB: Final = 5  # rad, course minus body yaw, Gauss-Markov part
GYRO: Final = 6  # rad/s, residual gyro bias
ACC: Final = 7  # m/s^2, forward acceleration bias
REF: Final = 8  # rad, error of the heading reference
OFFSET: Final = 9  # m, range offset of the primary anchor
N: Final = 10
PACKED: Final = N * (N + 1) // 2

WORK: Final = 320  # hypotheses of one row while it is being worked on
KEEP: Final = 192  # hypotheses of one row between batches, at most
RING_RANGES: Final = 15
WATCHED: Final = 4  # anchors of a row whose last ranges are kept; those of equal remainder share a slot
MODELS: Final = 4  # models of the heading error that are judged by their predictions
COMMON: Final = 4  # and two that are given by where the heading comes from
STEADY: Final = 5
WANDERING: Final = 2  # of the judged ones: heading and gyroscope drift apart, slowly

EXACT: Final = 0  # classes of hypotheses: the heading's error is as the model says
OWN_ERROR: Final = 1  # the heading reference has a slow error of its own, or drifts
DRIFTING: Final = 2  # it is the gyroscope that drifts, the heading does not

INITIALISING: Final = 0
AMBIGUOUS: Final = 1
TRACKING: Final = 2
COASTING: Final = 3
DEGRADED: Final = 4
LOST: Final = 5

SETTINGS: Final = [
    ("mount", np.float64),
    ("mount_std", np.float64),
    ("lever_x", np.float64),  # m, from the point that follows the course to the tag, body frame
    ("lever_y", np.float64),
    ("crab_std", np.float64),
    ("crab_tau", np.float64),  # s
    ("slip_known", np.uint8),  # 1: crab_std was told
    ("height", np.float64),  # m, tag antenna above the site's zero
    ("height_std", np.float64),
    ("range_std", np.float64),
    ("range_scale", np.float64),
    ("offset", np.float64),
    ("offset_std", np.float64),
    ("reference_std", np.float64),  # rad, constant error of the heading reference
    ("gyro_std", np.float64),  # rad/s, residual bias of the yaw increments
    ("v_max", np.float64),
    ("reverse", np.uint8),
    ("heading_source", np.uint8),
    ("heading_std", np.float64),  # rad, of a platform's heading that does not drift; NaN: not known
    ("start_known", np.uint8),
    ("start_x", np.float64),
    ("start_y", np.float64),
    ("start_std", np.float64),
    ("start_heading", np.float64),  # rad, body yaw, NaN: unknown
    ("start_heading_std", np.float64),
    ("start_speed_std", np.float64),
]

ROW: Final = np.dtype(
    [
        *SETTINGS,
        ("head", np.int32),  # first slot of this row, -1: none
        ("count", np.int32),
        ("t_ns", np.int64),
        ("anchor", np.int32),  # primary anchor, -1: none heard yet
        ("state", np.uint8),
        ("reason", np.uint8),
        ("fault", np.uint8),
        ("declared", np.uint8),
        ("model", np.uint8),  # of the heading error
        ("north", np.float64),  # rad, constant error of the heading reference, learned from a given start heading
        ("ring_count", np.int32),
        ("ring", np.float64, (RING_RANGES,)),
        ("ring_yaw", np.float64),
        ("ring_rest", np.uint8),
        ("ring_s", np.float64),
        ("since_manage_s", np.float64),
        ("since_clear_s", np.float64),  # since blocked hypotheses were last offered a clear line of sight
        ("since_range_s", np.float64),
        ("since_seed_s", np.float64),
        ("since_nlos_s", np.float64),
        ("last_x", np.float64),  # m, of the mode that was published last, from the anchor
        ("last_y", np.float64),
        ("good_s", np.float64),
        ("bad_s", np.float64),
        ("high_run", np.int32),
        ("low_run", np.int32),
        ("misfit", np.float64),  # forgetting mean of the best hypothesis' outlier probability
        ("hm_mean", np.float64, (MODELS, 3)),
        ("hm_cov", np.float64, (MODELS, 3, 3)),
        ("hm_loglik", np.float64, (MODELS,)),
        ("hm_started", np.uint8),
        ("referred", np.uint8),  # 1: the yaw of the hypotheses is in the site frame
        ("information", np.float64, (3, 3)),
        ("unwatched_s", np.float64),  # s of motion that no sensor watched, and where the tag was before
        ("gap_x", np.float64),  # m, from the anchor
        ("gap_y", np.float64),
        ("gap_var", np.float64),  # m^2
        ("gap_speed", np.float64),
        ("gap_course", np.float64),
        ("gap_yaw", np.float64),  # rad, then, and what was watched of its turns since
        ("gap_yaw_var", np.float64),  # rad^2
        ("gap_unheard", np.float64),  # s of turns that were not
        ("watched_s", np.float64),  # since the last such gap
        ("pieces", np.uint8),  # of samples that were heard between gaps since the track was lost
        ("coarse", np.uint8),  # 1: it began again after such a gap, with few and wide hypotheses until one is declared
        ("again", np.uint8),  # 1: the start is where the tag was before such a gap
        ("lever_rate", np.float64),  # rad/s, mean of the last node
        ("last_anchor", np.int32, (WATCHED,)),  # of each slot: the last range, how often and since when it is the same
        ("last_z", np.float64, (WATCHED,)),
        ("same_count", np.int32, (WATCHED,)),
        ("same_ns", np.int64, (WATCHED,)),
    ]
)

SLOT: Final = np.dtype(
    [
        ("next", np.int32),
        ("kind", np.int32),  # EXACT, OWN_ERROR or DRIFTING
        ("blocked", np.int32),  # 1: the range is now longer than the line of sight
        ("free", np.int32),  # in slot 0: how many slots are free
        ("log_weight", np.float64),
        ("clear_offset", np.float64),  # offset before the line of sight was blocked
        ("clear_variance", np.float64),
        ("mean", np.float64, (N,)),
        ("cov", np.float64, (PACKED,)),
    ]
)

BELIEF: Final = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("course", np.float64),
        ("yaw", np.float64),
        ("speed", np.float64),
        ("yaw_rate", np.float64),
        ("cov", np.float64, (3, 3)),  # of x, y, course
        ("p_mode", np.float64),
        ("sigma_pos", np.float64),
        ("sigma_obs", np.float64),
        ("range_m", np.float64),
        ("innovation", np.float64),  # of the likeliest hypothesis; innovation_variance 0: nothing was compared
        ("innovation_variance", np.float64),
        ("p_outlier", np.float64),
        ("hypotheses", np.int32),
        ("state", np.uint8),
        ("reason", np.uint8),
    ]
)


HYPOTHESIS: Final = np.dtype(
    [
        ("log_weight", np.float64),
        ("kind", np.int32),
        ("blocked", np.int32),
        ("clear", np.float64, (2,)),  # offset and its variance before the line of sight was blocked
        ("mean", np.float64, (N,)),
        ("cov", np.float64, (N, N)),
        ("shift", np.float64, (N,)),  # scratch of merging and splitting
        ("weight", np.float64),  # what follows is filled by `locate`
        ("direction", np.float64, (2,)),  # unit vector from the anchor
        ("place", np.float64, (2,)),  # m, from the anchor
        ("spread", np.float64),  # m^2, variance but for a rotation of everything about the anchor
        ("order", np.int32),  # index of the k-th heaviest
        ("gone", np.bool_),
        ("member", np.bool_),  # of the mode under consideration
        ("taken", np.bool_),  # by a mode considered before
    ],
    align=True,
)

SCRATCH: Final = np.dtype(
    [
        ("decay", np.float64, (N,)),
        ("growth", np.float64, (N,)),
        ("F", np.float64, (4, N)),
        ("FP", np.float64, (4, N)),
        ("H", np.float64, (N,)),
        ("PH", np.float64, (N,)),
        ("out", np.float64, (3,)),
        ("mean", np.float64, (5,)),
        ("cov", np.float64, (3, 3)),
        ("part", np.float64, (3, 3)),
        ("share", np.float64, (3,)),
        ("point", np.float64, (3,)),
    ]
)


# What one thread works on. One record, because compiled code counts no references to parts of a record.
WORKSPACE: Final = np.dtype([("hypotheses", HYPOTHESIS, (WORK,)), ("scratch", SCRATCH)], align=True)


def make_workspace() -> npt.NDArray[np.void]:
    """WORKSPACE (1,): for one thread, with room for the hypotheses of one row, unpacked."""
    return np.zeros(1, WORKSPACE)


def make_pool(capacity: int) -> npt.NDArray[np.void]:
    """Slots in one free list: slot 0 is its head and never used otherwise."""
    pool = np.zeros(capacity, SLOT)
    pool["next"] = np.arange(1, capacity + 1)
    pool["next"][-1] = -1
    pool["free"][0] = capacity - 1
    return pool


def with_room(pool: npt.NDArray[np.void], slots: int) -> npt.NDArray[np.void]:
    """The pool, or a larger one with the same hypotheses, that has this many free slots."""
    have, free = len(pool), int(pool["free"][0])
    if free >= slots:
        return pool
    grown = make_pool(max(have + slots, 2 * have))
    added = len(grown) - have
    grown["next"][-1] = pool["next"][0]
    grown[1:have] = pool[1:]
    grown["next"][0], grown["free"][0] = have, free + added
    return grown
