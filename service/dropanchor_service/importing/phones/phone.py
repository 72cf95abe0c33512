"""The sensors of a phone as an IMU in the axes of a tag, by the rules of the tag client."""

from collections.abc import Mapping

import numpy as np

from dropanchor_service.estimation.columns import Array
from dropanchor_service.importing.readings import ACC, GYRO, MAG, ImportingError, Readings, Unit
from dropanchor_service.importing.streams import Stream, no_readings
from dropanchor_tag_client.sources.phones.pairing import FLAT_MPS2, MAX_GAP_NS, Signs
from dropanchor_tag_client.sources.phones.readings import GRAVITY, GYROSCOPE, LINEAR, MAGNETOMETER, TOTAL

AXES_NOTE = "the axes of the phone are those of the tag: the top edge points forward, the screen up"
_BODY_FROM_PHONE = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def imu_readings(streams: Mapping[str, Stream], signs: Signs, source: str) -> Readings:
    """Return the IMU of a phone. streams: by sensor, in the phone's axes. Raises ImportingError."""
    _require_sensors(streams, source)
    parts = (TOTAL,) if TOTAL in streams else (LINEAR, GRAVITY)
    readings = Readings()
    readings.gyro = _in_body(streams[GYROSCOPE])
    readings.mag = _in_body(streams.get(MAGNETOMETER, no_readings()))
    force = _force([streams[name] for name in parts], streams[GYROSCOPE].t_ns)
    readings.acc = _in_body(Stream(force.t_ns, force.values * _sign(streams, signs, source)))
    readings.units = {ACC: Unit("m/s2"), GYRO: Unit("rad/s"), MAG: Unit("uT")}
    said = "Total Acceleration" if TOTAL in streams else "Accelerometer plus Gravity"
    readings.notes += [f"{source}: acceleration from {said}", f"{source}: {AXES_NOTE}"]
    return readings


def _force(parts: list[Stream], t_ns: Array) -> Stream:
    """Return the sum of the accelerations at the times at which all of them are known."""
    at = [part.at(t_ns, MAX_GAP_NS) for part in parts]
    usable = np.logical_and.reduce([known for _, known in at])
    return Stream(t_ns[usable], np.sum([values for values, _ in at], axis=0)[usable])


def _sign(streams: Mapping[str, Stream], signs: Signs, source: str) -> float:
    """Return 1 where accelerations are specific forces, -1 where they are their negatives. Raises ImportingError.

    Total acceleration has Android's sign. Gravity tells by the screen, which is up while the phone lies flat.
    """
    if TOTAL in streams or signs is not Signs.AUTO:
        return -1.0 if signs is Signs.IOS and TOTAL not in streams else 1.0
    z = streams[GRAVITY].values[:, 2]
    flat = z[np.abs(z) > FLAT_MPS2]
    if not len(flat):
        raise ImportingError(
            f"{source}: the phone never lay flat with its screen up, which shows the sign of its accelerations: say it "
            "with --signs ios or --signs android"
        )
    return float(np.sign(flat[0]))


def _in_body(stream: Stream) -> Stream:
    return Stream(stream.t_ns, stream.values @ _BODY_FROM_PHONE.T)


def _require_sensors(streams: Mapping[str, Stream], source: str) -> None:
    if GYROSCOPE not in streams:
        raise ImportingError(f"{source} has no readings of the gyroscope: record it, too")
    if TOTAL not in streams and not {LINEAR, GRAVITY} <= set(streams):
        has = "has accelerations without gravity only" if LINEAR in streams else "has no accelerations"
        raise ImportingError(
            f"{source} {has}: record the acceleration with gravity (Sensor Logger: Total Acceleration on Android, "
            "Accelerometer and Gravity on an iPhone; phyphox: Acceleration (with g))"
        )
