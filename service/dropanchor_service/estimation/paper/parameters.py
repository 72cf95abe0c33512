"""The parameters of Algorithm 1, with units and the sources of their values."""

import math
from dataclasses import dataclass, field

from dropanchor_service.estimation.paper.attitude import AttitudeParameters

RELEASED_STEP = 0.005  # s: the step of the authors' released simulation, for which its Q are given


@dataclass(frozen=True)
class PaperParameters:
    """The parameters. Defaults are the paper's values, or those of the authors' released code if the paper has none.

    Released code: github.com/MISTLab/RangeTracker, commit b0394c6 (trackerCore/tracker.py, speedEstimator.py,
    parameters.py). Its covariances per step of 0.005 s are given here as powers per second. Values marked "ours" are in
    neither. The defaults suit their simulation: 200 Hz, 0.005 m and 0.01 rad of noise (the paper says 0.2 m
    and 0.1 rad; the data released with the code has the former). `TUNED` has values for realistic noise.
    """

    # extended Kalman filter
    q_position: float = 0.01 / RELEASED_STEP  # m²/s, of x and of y; released: covS_X = covS_Y = 0.01
    q_heading: float = 0.01 / RELEASED_STEP  # rad²/s; released: covS_Ori = 0.01
    q_speed: float = 0.01 / RELEASED_STEP  # (m/s)²/s; released: covS_LVel = 0.01
    q_turn_rate: float = 0.01 / RELEASED_STEP  # (rad/s)²/s; ours: the released filter has no w, the paper's has
    range_std: float = math.sqrt(0.1)  # m, if neither sample nor tag gives it; released: covM_Range = 0.1 m²
    heading_std: float = math.sqrt(0.1)  # rad, if the sample does not give it; released: covM_Ori = 0.1 rad²
    start_std: float = 1.0  # m, if the start does not give it; released: P0 = I
    start_heading_std: float = 1.0  # rad; released: P0 = I
    start_speed_std: float = 1.0  # m/s; released: P0 = I, speed 0
    start_turn_rate_std: float = 1.0  # rad/s; ours, as P0 = I
    gate: float = 5.0  # standard deviations of the range innovation; ours: the paper has none, inf is as published
    heading_interval: float = (
        0.1  # s between attitudes that are fused while no range arrives; ours: the paper's come together
    )

    # range filter
    q_smooth: float = 0.001 / RELEASED_STEP  # m²/s; released: rangeKF.Q = 0.001
    r_smooth: float = 0.1  # m²; released: rangeKF.R = 0.1

    # speed estimator
    th_distance: float = 0.05  # m, TH_distance; released: distanceThreshold
    th_turn_rate: float = 0.1  # rad/s, TH_linear_motion on |gyro|; ours: the paper gives no value
    th_turn: float = 0.1  # rad, the same for a tag without gyroscope; released: lineMovingThreshold, on the heading
    pair_spacing: int = 10  # key pairs from point to point; released: 10 (paper: 1, consecutive pairs)
    window_base: float = 5.0  # speeds; released: window 5 + 0.1 range (paper: range · ratio)
    window_ratio: float = 0.1  # speeds per m
    blend: float = 0.5  # w of v <- w v + (1 - w) v_hat; released: 0.5

    # tracking state, all ours
    coasting_after: float = 1.0  # s without a fused range
    lost_after: float = 30.0  # s without a fused range
    heading_stale_after: float = 1.0  # s without a heading
    degraded_sigma: float = 1.5  # m of sigma_pos ...
    degraded_share: float = 0.05  # ... or this share of the range, whichever is larger

    backwards: float = 1.0  # standard deviations below zero at which a speed counts as driving backwards

    attitude: AttitudeParameters = field(default_factory=AttitudeParameters)


TUNED = PaperParameters(
    q_position=0.002,
    q_heading=0.2,
    q_speed=0.5,
    q_turn_rate=2.0,
    range_std=0.25,
    heading_std=0.1,
    start_std=0.1,
    start_heading_std=0.1,
    start_speed_std=0.1,
    start_turn_rate_std=0.1,
    q_smooth=0.5,
    r_smooth=0.05,
    th_distance=2.0,
    th_turn_rate=0.07,
    pair_spacing=1,
    window_base=1.0,
    window_ratio=0.12,
)
"""Algorithm 1 for realistic noise, from a random search on simulated tags only, never on recordings.

The tags: straight legs of 8 to 14 s at 0.5 to 4 m/s from a known start, ranges at 10 Hz with 0.1 m, headings of a
platform with 0.05 rad or a 9-axis IMU at 100 Hz; seeds 1000 to 1011. On other seeds (2000 to 2023) the median RMSE is
0.27 m (platform) and 0.73 m (IMU), and 8 % and 21 % of the runs are lost to the mirror image of the track. With these
values the speed estimator hardly matters (0.26 and 0.71 m without it): its gain in the paper is over an untuned filter.
"""
