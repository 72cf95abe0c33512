"""The sensors of a phone as an IMU in the axes of a tag, by the same rules as for phones that send live."""

from collections.abc import Mapping

import numpy as np

from dropanchor_service.importing.readings import ACC, GYRO, MAG, ImportingError, Readings, Unit
from dropanchor_service.phones.pairing import Pairing, Signs
from dropanchor_service.phones.readings import GRAVITY, GYROSCOPE, LINEAR, TOTAL
from dropanchor_service.phones.streams import Stream, make_stream

AXES_NOTE = "the axes of the phone are those of the tag: the top edge points forward, the screen up"


def imu_readings(streams: Mapping[str, Stream], signs: Signs, source: str) -> Readings:
    """Return the IMU of a phone. streams: by sensor, in the phone's axes. Raises ImportingError."""
    _require_sensors(streams, source)
    paired = Pairing(signs).add(streams)
    if not paired.samples:
        raise ImportingError(
            f"{source}: no turn rate has an acceleration at its time. If the phone never lay flat with its screen up, "
            "which shows the sign of the accelerations, say it: --signs ios or --signs android"
        )
    readings = Readings(is_utc=True)
    readings.left_out.add(source, "turn rates without an acceleration at their time", count=paired.unpaired)
    t_ns = np.array([sample.t_ns for sample in paired.samples], np.int64)
    readings.acc = make_stream(t_ns, np.array([sample.acc for sample in paired.samples]))
    readings.gyro = make_stream(t_ns, np.array([sample.gyro for sample in paired.samples]))
    with_field = [sample for sample in paired.samples if sample.mag is not None]
    readings.mag = make_stream(
        np.array([sample.t_ns for sample in with_field], np.int64), np.array([sample.mag for sample in with_field])
    )
    readings.units = {ACC: Unit("m/s2"), GYRO: Unit("rad/s"), MAG: Unit("uT")}
    parts = "Total Acceleration" if TOTAL in streams else "Accelerometer plus Gravity"
    readings.notes += [f"{source}: acceleration from {parts}", f"{source}: {AXES_NOTE}"]
    return readings


def _require_sensors(streams: Mapping[str, Stream], source: str) -> None:
    if GYROSCOPE not in streams:
        raise ImportingError(f"{source} has no readings of the gyroscope: record it, too")
    if TOTAL not in streams and not {LINEAR, GRAVITY} <= set(streams):
        has = "has accelerations without gravity only" if LINEAR in streams else "has no accelerations"
        raise ImportingError(
            f"{source} {has}: record the acceleration with gravity (Sensor Logger: Total Acceleration on Android, "
            "Accelerometer and Gravity on an iPhone; phyphox: Acceleration (with g))"
        )
