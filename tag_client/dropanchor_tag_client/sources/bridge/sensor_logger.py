"""Messages of the app Sensor Logger, which publishes the readings of a phone's sensors."""

from collections import OrderedDict
from collections.abc import Iterator

from dropanchor_schemas.wire import ImuSample
from dropanchor_tag_client.sources.bridge.measurement import (
    MAX_PAYLOAD_BYTES,
    Drop,
    Dropped,
    Format,
    Found,
    Measurement,
    Received,
    refused_retained,
    too_long,
)
from dropanchor_tag_client.sources.phones.pairing import Signs
from dropanchor_tag_client.sources.phones.problems import TILTED
from dropanchor_tag_client.sources.phones.readings import TITLES, PhoneError
from dropanchor_tag_client.sources.phones.sensor_logger import Message, parse
from dropanchor_tag_client.sources.phones.session import WAIT_S, Session, Taken

_MAX_RECORDINGS = 256


class SensorLogger(Format):
    """topic: the one that is set in the app. A `+` in it stands for the tag; without one, the phone's device id does.
    signs: which way the accelerations of the phones point."""

    def __init__(self, topic: str, signs: Signs = Signs.AUTO) -> None:
        self.topics: tuple[str, ...] = (topic,)
        self._signs = signs
        self._tag_level = topic.split("/").index("+") if "+" in topic.split("/") else None
        self._recordings: OrderedDict[tuple[str, str], Session] = OrderedDict()

    def parse(self, message: Received) -> Iterator[Found]:
        if message.retained:
            yield refused_retained(message)
            return
        if len(message.payload) > MAX_PAYLOAD_BYTES:
            yield too_long(message.payload)
            return
        try:
            readings = parse(message.payload)
        except PhoneError as error:
            yield Dropped(Drop.NOT_UNDERSTOOD, f"{message.topic}: {error}")
            return
        if readings is None:
            return
        tag = readings.device_id if self._tag_level is None else message.topic.split("/")[self._tag_level]
        if not tag:
            yield Dropped(Drop.TAG_INVALID, "the message has no deviceId")
            return
        yield from self._found(tag, readings, message.t_ns * 1e-9)

    def overdue(self, t_ns: int) -> Iterator[Found]:
        for (tag, _), session in self._recordings.items():
            if session.waiting_since_s is not None:
                yield from _of(tag, session.release(t_ns * 1e-9 - WAIT_S))

    def _found(self, tag: str, readings: Message, now_s: float) -> Iterator[Found]:
        taken = self._recording(tag, readings.session_id).take(readings, now_s)
        yield from _of(tag, taken)
        if taken.duplicate:
            yield Dropped(Drop.DUPLICATE, f"tag {tag}: message {readings.message_id}")
            return
        for sensor, what in readings.damage.items():
            yield Dropped(Drop.DAMAGED, f"tag {tag}: readings of {TITLES[sensor]} {what}")
        for pressure in readings.pressures:
            yield Measurement(tag, "pressure", {"pressure_pa": pressure.pressure_pa, "t_ns": pressure.t_ns})
        if readings.battery_fraction is not None:
            yield Measurement(tag, "health", {"battery_fraction": readings.battery_fraction})

    def _recording(self, tag: str, session_id: str) -> Session:
        recording = self._recordings.pop((tag, session_id), None) or Session(self._signs)
        self._recordings[tag, session_id] = recording
        if len(self._recordings) > _MAX_RECORDINGS:
            self._recordings.popitem(last=False)
        return recording


def _of(tag: str, taken: Taken) -> Iterator[Found]:
    """Yield the samples that are complete, and why there are none."""
    for sample in taken.samples:
        yield Measurement(tag, "imu", _fields(sample))
    if taken.problem:
        yield Dropped(Drop.SIGN_UNKNOWN if taken.problem == TILTED else Drop.NO_MOTION, f"tag {tag}: {taken.problem}")
    elif taken.unpaired:
        text = f"tag {tag}: {taken.unpaired} readings of Gyroscope without an acceleration at their time"
        yield Dropped(Drop.UNPAIRED, text)


def _fields(sample: ImuSample) -> dict[str, object]:
    mag = None if sample.mag is None else list(sample.mag)
    return {"acc": list(sample.acc), "gyro": list(sample.gyro), "mag": mag, "t_ns": sample.t_ns}
