"""A person who carries the tag in the hand or in a pocket: raw samples, ranges and truth."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from dropanchor_tag_client.simulator.families import REST_S
from dropanchor_tag_client.simulator.gait import IN_HAND, Shaking, Shape, Walker, draw_walker, shaking
from dropanchor_tag_client.simulator.imu import (
    GRAVITY,
    Attitude,
    Imu,
    ImuUnit,
    body_rates,
    draw_unit,
    draw_waves,
    into_body,
    path_acceleration,
    quaternions,
    turned,
    untilted,
)
from dropanchor_tag_client.simulator.noise import Stream, stream
from dropanchor_tag_client.simulator.ranging import AnchorPlace, RangeModel, Ranges
from dropanchor_tag_client.simulator.scenarios import MIN_DISTANCE_M
from dropanchor_tag_client.simulator.sensors import SensorModels
from dropanchor_tag_client.simulator.simulation import Simulation, Truth, with_row_before
from dropanchor_tag_client.simulator.trajectory import Array, Segment, Start, Trajectory, drive

Carry = Literal["hand", "pocket", "turned"]
CARRIES: tuple[Carry, ...] = ("hand", "pocket", "turned")

DT = 0.01
HEIGHT_M = 1.2
MAX_DISTANCE_M = 40.0  # from the anchor; recorded walks: 10 to 58 m, median 31 m
ANCHORS = (AnchorPlace(z=2.2),)
TURN_S = 1.0
NLOS_MAX_M = 0.6
NLOS_LOST_SHARE = 0.2
# A thigh swings by about 0.35 rad with every stride. There were no recordings from a pocket. The swing and the forward
# acceleration are typical values; all others are those of the hand.
POCKET = replace(
    IN_HAND,
    pitch=Shape((1.4, 0.5, 0.2, 0.2, 0.15, 0.1, 0.09, 0.08)),
    forward=Shape((1.2, 1.2, 0.3, 0.4, 0.3, 0.2, 0.2, 0.15), math.radians(54.0)),
)


class Hold(NamedTuple):
    """How the person holds the device.

    mount: course minus yaw of the device, (n,) rad. frame: (3, 3) rotation from the swinging frame (x ahead, z up) to
    the device's axes.
    """

    mount: Array
    frame: Array


def walking_sensors(models: SensorModels | None = None) -> SensorModels:
    """Return the sensors of a carried tag: no wheel vibration, ranges of 0.08 m at 10 Hz, 1 m below the anchor."""
    models = models or SensorModels()
    imu = replace(models.imu, vibration_acc=0.0, vibration_gyro=0.0, rocking_std=0.0, lean_std=0.03)
    return replace(models, imu=imu, ranges=RangeModel(hz=10.0, std=0.08), anchors=ANCHORS, height_m=HEIGHT_M)


def simulate_walk(carry: Carry, seed: int, models: SensorModels | None = None) -> Simulation:
    """Return a walk of 60 to 90 s, which depends only on the arguments.

    hand: held in front, N(0, 0.15) rad off the direction of travel, with a sway of 0.18 rad over 5 to 30 s (recorded:
    0.11 to 0.32, median 0.19). turned: the same, and turned by ±90° within 1 s in the middle third of the walk.
    pocket: upright, with a random side ahead.
    Ranges have a constant bias (sd 0.1 m). Ranges from behind the walker are up to 0.6 m too long, and 20 % of them are
    lost.
    """
    models = models or walking_sensors()
    rng = stream(seed, Stream.GAIT)
    walker = draw_walker(rng)
    motion = walk(walker, stream(seed, Stream.MOTION))
    hold = _hold(carry, motion, rng)
    swing = shaking(with_row_before(motion), walker, POCKET if carry == "pocket" else IN_HAND, rng)
    unit = draw_unit(models.imu, 0.0, stream(seed, Stream.IMU_UNIT))
    error = models.heading_error.draw(motion, stream(seed, Stream.HEADING_ERROR))
    imu, attitude = _measured(motion, hold, swing, unit, (error, stream(seed, Stream.IMU)))
    scalars = models.scalar.measure(motion, 0.0, error - hold.mount, stream(seed, Stream.SCALAR))
    return Simulation(
        scenario=f"walk-{carry}",
        seed=seed,
        anchors=models.anchors,
        truth=_truth(motion, hold, attitude, models.height_m),
        imu=imu,
        ranges=_ranges(models, motion, seed),
        scalars=scalars,
    )


def walk(walker: Walker, rng: np.random.Generator) -> Trajectory:
    """Return the path: a rest, then five to seven straight or curved legs with quick turns and occasional stops."""
    while True:
        start = Start(10.0, 0.0, rng.uniform(-math.pi, math.pi))
        motion = drive(_legs(walker, rng), start, DT)
        if motion.distance.min() >= MIN_DISTANCE_M and motion.distance.max() <= MAX_DISTANCE_M:
            return motion


def _legs(walker: Walker, rng: np.random.Generator) -> Iterator[Segment]:
    yield Segment(REST_S + rng.uniform(0.0, 2.0), 0.0)
    for leg in range(int(rng.integers(5, 8))):
        if leg and rng.random() < 0.15:
            yield Segment(0.8 + rng.uniform(1.0, 4.0), 0.0, ramp_s=0.8)
        speed = walker.speed * rng.uniform(0.93, 1.05)
        bend = rng.uniform(-0.08, 0.08) if rng.random() < 0.5 else 0.0
        turn = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 2.2)) if leg else 0.0
        yield Segment(rng.uniform(8.0, 16.0), speed, yaw_rate=bend, turn=turn, ramp_s=1.2)


def _hold(carry: Carry, motion: Trajectory, rng: np.random.Generator) -> Hold:
    sway = draw_waves(rng, 0.18, (5.0, 30.0)).at(motion.t)
    if carry == "pocket":
        tilt = 0.15 * rng.standard_normal(2)
        upright = float(rng.choice([-1.0, 1.0])) * math.pi / 2
        return Hold(0.3 * sway, _frame(rng.uniform(-math.pi, math.pi), upright + tilt[0], tilt[1]))
    mount = rng.normal(0.0, 0.15) + sway
    if carry == "turned":
        begin = motion.t[-1] * rng.uniform(1 / 3, 2 / 3)
        share = np.clip((motion.t - begin) / TURN_S, 0.0, 1.0)
        mount = mount + float(rng.choice([-1.0, 1.0])) * math.pi / 2 * (1 - np.cos(math.pi * share)) / 2
    return Hold(mount, np.eye(3))


def _frame(yaw: float, pitch: float, roll: float) -> Array:
    """Return (Rz(yaw) Ry(pitch) Rx(roll))ᵀ."""
    attitude = Attitude(*(np.full(1, angle) for angle in (roll, pitch, yaw)))
    return np.stack([into_body(attitude, axis[None, :])[0] for axis in np.eye(3)], axis=1)


def _measured(
    motion: Trajectory, hold: Hold, swing: Shaking, unit: ImuUnit, error_and_noise: tuple[Array, np.random.Generator]
) -> tuple[Imu, Attitude]:
    """Return the unit's samples, and the attitude of the swinging frame at the rows of the motion."""
    error, rng = error_and_noise
    before = with_row_before(motion)
    mount = np.concatenate([hold.mount[:1], hold.mount])
    slow = [draw_waves(rng, std, (3.0, 20.0)) for std in (0.015, 0.03)]
    attitude = Attitude(
        unit.lean[0] + slow[0].at(before.t) + swing.roll,
        unit.lean[1] + slow[1].at(before.t) + swing.pitch,
        before.course - mount + swing.yaw,
    )
    forward, leftward = path_acceleration(before)
    level = turned(forward + swing.forward, leftward + swing.leftward, GRAVITY + swing.upward, mount)
    field = unit.field(before.t, np.concatenate([error[:1], error]))
    columns = (untilted(attitude, level), body_rates(attitude, before.dt), into_body(attitude, field))
    exact = Imu(before.t, *(column @ hold.frame.T for column in columns))
    imu = unit.with_errors(exact, np.zeros(len(before)), rng)
    return imu, Attitude(*(angle[1:] for angle in attitude))


def _truth(motion: Trajectory, hold: Hold, attitude: Attitude, height: float) -> Truth:
    """Return the truth. The heading excludes the swing; the attitude is that of the swinging frame, not the device."""
    return Truth(
        t_s=motion.t,
        x=motion.x,
        y=motion.y,
        z=np.full(len(motion), height),
        heading=motion.course - hold.mount,
        course=motion.course,
        v=motion.v,
        w=motion.w,
        attitude=quaternions(attitude),
    )


def _ranges(models: SensorModels, motion: Trajectory, seed: int) -> Ranges:
    ranges = models.ranges.measure(motion, models.height_m, models.anchors, stream(seed, Stream.RANGE))
    rng = stream(seed, Stream.NLOS)
    bias = rng.normal(0.0, 0.1)
    behind = behind_the_walker(motion, ranges, models.anchors)
    excess = NLOS_MAX_M * behind * rng.random(len(behind))
    lost = rng.random(len(behind)) < NLOS_LOST_SHARE * (behind > 0.0)
    return ranges._replace(range_m=np.maximum(ranges.range_m + bias + excess, 0.0)).where(~lost)


def behind_the_walker(motion: Trajectory, ranges: Ranges, anchors: Sequence[AnchorPlace]) -> Array:
    """Return for each range how far its anchor is behind the walker: 1 straight behind, 0 at the side or ahead."""
    there = motion.at(ranges.t_s)
    x, y = (np.array([anchor[axis] for anchor in anchors])[ranges.anchor] for axis in (1, 2))
    ahead = np.cos(np.arctan2(y - there.y, x - there.x) - there.course)
    return np.maximum(-ahead, 0.0)
