"""The parameters of the pose belief, as one value that compiled code is given."""

from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from dropanchor_service.estimation.fleet.belief.births.numbers import ALL
from dropanchor_service.estimation.fleet.compiled import njit

TuningRecord: TypeAlias = npt.NDArray[np.void]  # (1,), what `Tuning.record` returns


class Tuning(NamedTuple):
    """Defaults for every tag. What an operator says about one tag is in the settings of its row.

    Compiled code is given the record that `record` returns, with the same names: it is annotated as Tuning, too.
    """

    q_position: float = 1e-4  # m^2/s
    q_speed: float = 1e-4  # m^2/s^3, with an accelerometer
    q_speed_no_acc: float = 0.03  # m^2/s^3, without one
    q_speed_no_acc_moving: float = 0.04  # per (m/s)^2 of speed, up to 1 m/s
    mount_known_std: float = 0.02  # rad, of a mounting angle that is told, or of a platform's own heading
    platform_slip_std: float = 0.15  # rad, of a heading without an IMU: slip, and lag of the readings
    platform_slip_tau: float = 1.0  # s
    mount_untold_std: float = 0.05  # rad, above which a mounting angle counts as one that nobody told
    mount_cell: float = 0.3  # rad, between the guesses of a mounting angle that nobody told
    mount_cells: int = 10  # guesses on each side: all around
    mount_straight: float = 0.5  # share of tags that point about ahead
    mount_any: float = 0.2  # share of tags that may point anywhere
    drift_std: float = 0.006  # rad/s, of a platform's heading that drifts
    q_gyro: float = 1e-7  # (rad/s)^2/s, of a tag whose platform measures its heading beside it
    class_rejected_weight: float = 1e-3  # weight below which a heading class no longer counts for the ellipse
    q_gyro_own: float = 1e-6  # the same, of all others
    acc_bias_std: float = 0.11  # m/s^2
    left_bias_std: float = 0.2  # m/s^2, larger: an arc tilts the sideways axis for seconds
    acc_bias_roughness: float = 0.7  # s: its variance grows by this times dv_var / dt, the roughness of the motion
    bending_roughness: float = 0.05  # (m/s)^2/s of it, up to which ramps of the speed count: they bend the tilt
    acc_bias_tau: float = 5.0  # s
    bending_s: float = 2.0  # s for which an arc bends the tilt of a mount in one direction, unless it is rigid
    range_bias_std: float = 0.15  # m, of an uncalibrated tag and anchor pair: antenna delays
    range_bias_tau: float = 25.0  # s in which the bias becomes another one, with the place and the attitude
    q_nlos: float = 0.02  # m^2/s, range bias without line of sight
    likelihood_power: float = 0.7  # of a range: its error is like that of the one before
    noise_log_prior: float = -0.3  # of each level of errors of ranges that last, a factor 4 of the variance
    noise_told_log_prior: float = -8.0  # the same, of a tag whose range_std was told
    noise_block_s: float = 2.0  # s of ranges whose errors are judged together
    noise_memory_s: float = 20.0  # s after which a judgement is forgotten
    noise_peak_s: float = 60.0  # s after which a level of before is forgotten
    outlier_probability: float = 0.02  # of a range
    outlier_mean: float = 0.8  # m
    outlier_std: float = 0.8  # m
    outlier_floor: float = 1e-4  # 1/m, density of an outlier of any length
    nlos_log_prior: float = -2.5  # of a line of sight that was lost, or is back
    nlos_max_bias: float = 3.6  # m, extra bias above which the track is wrong and not the range
    nlos_tau: float = 2.0  # s
    nlos_run: int = 4  # ranges in a row that are too long or too short
    own_error_log_prior: float = -1.0  # log prior of a slow error of the heading reference
    own_error_again_log_prior: float = -2.0  # added when that class is tried again after it had died out
    own_error_std: float = 0.15  # rad
    split_angle: float = 0.08  # rad
    split_curvature: float = 0.4  # of the range rate, over the errors of angle and speed, from which on it is split
    coarse_split_angle: float = 0.2  # rad, of a tag that starts again after a gap, until it is resolved
    coarse_hypotheses: int = 48  # hypotheses of such a tag
    coarse_bearings: int = 24  # around the anchor, of such a tag
    coarse_speeds: int = 3  # for each of them
    merge_distance: float = 0.5  # standard deviations, of hypotheses of equal weight
    merge_distance_at_rest: float = 1.0  # the same, of a tag at rest
    merge_light: float = 0.5  # growth of its square per unit of log weight that the lighter one lacks
    prune_depth: float = 10.0  # log weight below the best
    rest_std: float = 0.02  # m/s
    rest_gyro_std: float = 0.003  # rad/s
    misfit_s: float = 3.0  # s of ranges that are mostly outliers, after which a track is widened
    reverse_slack: float = 0.05  # m/s
    reverse_log_prior: float = -4.5  # log prior of driving off in the other direction
    start_bearings: int = 36  # around the anchor, of an unknown start
    start_speeds: int = 5  # for each of them
    start_speed_max: float = 5.0  # m/s, the fastest of them
    mode_hysteresis: float = 2.0  # log weight by which another mode must win to be published
    resolved_weight: float = 0.99  # of one mode, from which on a tag is resolved
    resolved_s: float = 2.0  # s for which it has held it
    model_forget: float = 60.0  # s
    q_walk_speed: float = 0.3  # m^2/s^3, of a carried tag, as all that follows
    walk_speed_std: float = 0.4  # m/s, about the usual speed
    walk_speed_max: float = 2.2  # m/s
    walk_position_q: float = 0.03  # m^2/s
    walk_start_var: float = 0.05  # m^2
    walk_start_share: float = 0.2  # of the way since the person stood
    q_grip: float = 1e-3  # rad^2/s, of the mounting angle
    grips: int = 24  # mounting angles of a device that may be held in any way
    front_share: float = 0.6  # of the devices, which are held about as they point
    front_std: float = 0.3  # rad
    sway_std: float = 0.3  # rad
    sway_tau: float = 2.0  # s
    step_scale_std: float = 0.1  # log of the scale of a walker's step speed
    q_step_scale: float = 1e-4  # 1/s
    step_speed_share: float = 0.3  # of the speed that steps give
    step_speed_std: float = 0.2  # m/s, the least
    walk_gyro_bias_std: float = 0.01  # rad/s, at least: a rest in the hand is none
    stand_std: float = 0.5  # m/s
    gait_angle_std: float = 0.7  # rad
    gait_offset_std: float = 0.6  # rad
    device_turn_log_prior: float = -1.6  # of a quick turn of the device and not of its carrier
    device_turn_var: float = 0.2  # m^2
    device_turn_share: float = 0.1  # of such a turn, error of its angle
    walk_likelihood_power: float = 0.5  # of a range to a carried tag
    walk_spread: float = 1.8  # times the published variance: what this model leaves out of a person's motion
    walk_split_angle: float = 0.3  # rad
    walk_hypotheses: int = 24  # at most, of a carried tag
    obs_window: float = 10.0  # s
    obs_q: float = 0.003  # (m/s)^2/s, speed noise in the information about the bearing
    obs_q_no_acc: float = 0.05  # the same, without an accelerometer
    births: int = ALL  # a bit for each birth of hypotheses that is switched on (`belief/births/numbers.without`)

    def record(self) -> TuningRecord:
        """Return the parameters as a structured array (1,): compiled code gets one pointer instead of all numbers."""
        kinds = [(name, np.int64 if kind is int else np.float64) for name, kind in type(self).__annotations__.items()]
        return np.array([tuple(self)], kinds)


@njit(nogil=True)
def is_on(birth: int, t: Tuning) -> bool:
    """Return whether a birth, by its number, is switched on, so that an engine can run without it."""
    return bool((t.births >> birth) & 1 == 1)
