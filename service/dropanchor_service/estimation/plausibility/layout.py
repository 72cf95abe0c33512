"""What is known about the sensors of one tag: sums over blocks of half a second, and the verdicts."""

from typing import Any, Final, TypeAlias

import numpy as np

from dropanchor_service.estimation.fleet.compiled import njit
from dropanchor_service.estimation.plausibility.verdicts import ImuVerdict

AROUND: Final = 11  # steps from range to range, whose mean is the motion of the tag
GOOD, DOUBTS = int(ImuVerdict.GOOD), int(ImuVerdict.UPSIDE_DOWN)
LAGS: Final = 21  # what is left of a step, that is compared

BLOCK = np.dtype(
    [
        ("t_ns", "i8"),  # of its middle
        ("n", "i4"),  # samples; 0: there is none
        ("acc", "f8", 3),  # m/s², means
        ("gyro", "f8", 3),  # rad/s
        ("mag", "f8", 3),  # NaN: none
    ],
    align=True,
)

CHECK = np.dtype(
    [
        ("imu_verdict", "u1"),  # ImuVerdict
        ("range_verdict", "u1"),  # RangeVerdict
        ("sign_known", "u1"),  # 1: the operator says which way accelerations point, or turns have shown it
        ("imu_detail", "f4"),
        ("range_detail", "f4"),
        # the block that fills
        ("begin_ns", "i8"),
        ("t_ns", "i8"),  # of the last sample
        ("n", "i4"),
        ("acc", "f8", 3),  # sums
        ("gyro", "f8", 3),
        ("mag", "f8", 3),
        ("last", "f8", 6),  # acc and gyro of the last sample
        ("acc_ns", "i8"),  # when the acceleration was last another value, to the last bit
        ("gyro_ns", "i8"),
        ("before", BLOCK),
        ("vigorous_s", "f4"),  # until it is judged again after vigorous motion; 0: it is judged
        ("held_s", "f4"),  # for which the verdict has held, while it was judged
        # gravity
        ("known_s", "f4"),  # of blocks so far
        ("wrong_s", "f4"),  # of the last blocks without gravity
        ("right_s", "f4"),  # of the last blocks with gravity
        ("norm", "f4"),  # m/s², slow mean of |mean acceleration|
        ("level", "f4", 3),  # m/s², slow mean of the acceleration
        ("moved", "i4"),  # blocks with motion since the gyroscope changed
        # tilting, as the gyroscope tells it and as gravity shows it
        ("calm_ns", "i8"),  # of the last block whose acceleration was gravity; 0: none
        ("up", "f8", 3),  # direction of that
        ("told_up", "f8", 3),  # where the gyroscope says that it is now
        ("told_turn", "f8"),  # rad, since then
        ("tilted", "f4"),  # rad², sum of what the gyroscope told
        ("contradicted", "f4"),  # rad², sum of what gravity contradicted
        ("doubted_s", "f4"),  # for which a contradiction still lets the axes be doubted
        ("turned", "f4"),  # rad, without a contradiction since the last one
        ("peak", "f4"),  # rad/s
        ("rates", "f4", 3),  # rad², by axis, of what was contradicted
        # upside down
        ("upside_s", "f4"),
        ("dip_s", "f4"),  # with a field that points up at the same time, s
        ("left", "f4"),  # rad/s · m/s², yaw rate times acceleration to the left
        ("left_rate", "f4"),  # rad²/s²
        # turning of the field
        ("normal", "f8", (4, 4)),
        ("told", "f8", 4),
        ("field2", "f8"),
        ("field_blocks", "i4"),
        # raw counts
        ("absurd_imu", "i4"),  # in a row
        # ranges of one anchor
        ("anchor", "i4"),
        ("range_ns", "i8"),
        ("range", "f8"),  # m, the last one
        ("range_dt", "f8", 2),  # s, mean and last
        ("range_n", "i4"),
        ("second", "f4"),  # m, median size of second differences
        ("steps", "f4", AROUND),  # m, the last ones, NaN: none
        ("left_size", "f4"),  # m, median size of what is left of a step without its motion
        ("left_over", "f4", LAGS),  # m, the last of these, NaN: none
        ("products", "f4", LAGS),  # m², their mean products by lag
        ("products_n", "i4"),
        ("window_ns", "i8"),
        ("window", "f8", 2),  # sum and number of ranges in the second that fills
        ("window_before", "f8"),  # m, mean of the second before; NaN: none
        ("fast", "f4"),  # share of seconds with a speed that nothing has
        ("absurd_ranges", "f4"),  # share
        ("calm", "i4"),  # ranges without the sign of an average
    ],
    align=True,
)
Check: TypeAlias = Any  # a record of CHECK


@njit(nogil=True)
def may_be_used(verdict: int) -> bool:
    """Return whether an IMU with this verdict may be used: nothing shows, or there are doubts."""
    return verdict == GOOD or verdict >= DOUBTS


def make_checks(rows: int) -> np.ndarray[Any, np.dtype[np.void]]:
    """Return CHECK of tags that have sent nothing."""
    return np.zeros(rows, CHECK)
