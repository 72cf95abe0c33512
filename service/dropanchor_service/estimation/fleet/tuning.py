"""The parameters of the pose belief, as one value that compiled code is given."""

from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

TuningRecord: TypeAlias = npt.NDArray[np.void]  # (1,), what `Tuning.record` returns


class Tuning(NamedTuple):
    """Defaults for every tag. What an operator says about one tag is in the settings of its row.

    Compiled code is given the record that `record` returns, with the same names: it is annotated as Tuning, too.
    """

    q_position: float = 1e-4  # m^2/s
    q_speed: float = 1e-4  # m^2/s^3, with an accelerometer
    q_speed_no_acc: float = 0.03  # m^2/s^3, without one
    q_speed_no_acc_moving: float = 0.04  # per (m/s)^2 of speed, up to 1 m/s
    q_mount: float = 1e-6  # rad^2/s
    platform_mount_std: float = 0.02  # rad
    platform_slip_std: float = 0.15  # rad, of a heading without an IMU: slip, and lag of the readings
    platform_slip_tau: float = 1.0  # s
    aligned_std: float = 0.05  # rad, mounting angle of a tag whose body axis points along the course
    aligned_log_prior: float = 3.0
    mount_cell: float = 0.3  # rad, between the guesses of a mounting angle that nobody told
    mount_cells: int = 7  # guesses on each side
    mount_straight: float = 0.5  # share of tags that point about ahead
    mount_any: float = 0.05  # share of tags that may point anywhere in these cells
    gyro_bias_std: float = 0.02  # rad/s, residual bias
    drift_std: float = 0.006  # rad/s, of a platform's heading that drifts
    drift_log_prior: float = 0.0
    q_gyro: float = 1e-7  # (rad/s)^2/s, of a tag whose platform measures its heading beside it
    q_gyro_drift: float = 1e-4  # the same, of one that drifts
    class_rejected_weight: float = 1e-3  # weight below which a heading class no longer counts for the ellipse
    drift_again_log_prior: float = 0.0  # log prior of a drifting gyroscope, where heading and gyroscope drift apart
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
    likelihood_power: float = 0.7
    outlier_probability: float = 0.02
    outlier_mean: float = 0.8  # m
    outlier_std: float = 0.8  # m
    outlier_floor: float = 1e-4
    bilinear: float = 0.25  # second-order term: times the product of the variances of speed and slip, for a range
    nlos_log_prior: float = -2.5
    nlos_depth: float = 6.0  # log weight below the best at which a hypothesis gets no NLOS alternative
    nlos_min_bias: float = 0.15  # m, extra bias below which there is a line of sight
    nlos_max_bias: float = 3.6  # m, extra bias above which the track is wrong and not the range
    nlos_tau: float = 2.0  # s
    nlos_run: int = 4
    own_error_log_prior: float = -1.0  # log prior of a slow error of the heading reference
    own_error_again_log_prior: float = -2.0  # added when that class is tried again after it had died out
    own_error_std: float = 0.15  # rad
    own_error_tau: float = 60.0  # s
    split_angle: float = 0.08  # rad
    split_curvature: float = 0.4  # of the range rate, over the errors of angle and speed, from which on it is split
    coarse_split_angle: float = 0.2  # rad, of a tag that starts again after a gap, until it is resolved
    coarse_hypotheses: int = 48  # hypotheses of such a tag
    coarse_bearings: int = 24
    coarse_speeds: int = 3
    merge_distance: float = 0.5  # standard deviations, of hypotheses of equal weight
    merge_distance_at_rest: float = 1.0  # the same, of a tag at rest
    merge_light: float = 0.5  # growth of its square per unit of log weight that the lighter one lacks
    prune_depth: float = 10.0  # log weight below the best
    rest_std: float = 0.02  # m/s
    rest_gyro_std: float = 0.003  # rad/s
    misfit_s: float = 3.0
    reverse_slack: float = 0.05  # m/s
    reverse_log_prior: float = -4.5  # log prior of driving off in the other direction
    start_bearings: int = 36
    start_speeds: int = 5
    start_speed_max: float = 5.0
    mode_hysteresis: float = 2.0  # log weight by which another mode must win to be published
    resolved_weight: float = 0.99
    resolved_s: float = 2.0
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
    step_scale_std: float = 0.1
    q_step_scale: float = 1e-4  # 1/s
    step_speed_share: float = 0.3  # of the speed that steps give
    step_speed_std: float = 0.2  # m/s, the least
    walk_gyro_bias_std: float = 0.01  # rad/s, at least: a rest in the hand is none
    stand_std: float = 0.5  # m/s
    gait_angle_std: float = 0.7  # rad
    gait_offset_std: float = 0.6  # rad
    q_gait_offset: float = 1e-4  # rad^2/s
    device_turn_log_prior: float = -1.6
    device_turn_var: float = 0.2  # m^2
    device_turn_share: float = 0.1
    walk_range_factor: float = 8.0  # times the variance of a range: errors beside a body last for seconds
    walk_likelihood_power: float = 0.5
    walk_spread: float = 1.8  # times the published variance: what this model leaves out of a person's motion
    walk_outlier_probability: float = 0.03
    walk_outlier_mean: float = 0.4  # m
    walk_outlier_std: float = 0.4  # m
    walk_split_angle: float = 0.3  # rad
    walk_hypotheses: int = 24
    obs_window: float = 10.0  # s
    obs_q: float = 0.003
    obs_q_no_acc: float = 0.05

    def record(self) -> TuningRecord:
        """Return the parameters as a structured array (1,): compiled code gets one pointer instead of all numbers."""
        kinds = [(name, np.int64 if kind is int else np.float64) for name, kind in type(self).__annotations__.items()]
        return np.array([tuple(self)], kinds)
