"""What the formats make of messages: pure functions of topic and payload."""

import base64
import json
import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_tag_client.sources.bridge.decawave import Decawave
from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Format, Measurement, Received
from dropanchor_tag_client.sources.bridge.sensor_logger import SensorLogger
from dropanchor_tag_client.sources.phones.pairing import Signs
from support.sensor_logger import G, Value, message, reading, recording

NOW_NS = 1_800_000_000_000_000_000
MS = 1_000_000


ANDROID: dict[str, Value] = {"gyroscope": lambda _: (0.0, 0.0, 0.1), "totalacceleration": lambda _: (0.0, 0.0, G)}


def parsed(one: Format, topic: str, value: Any) -> list[Measurement | Dropped]:
    payload = value if isinstance(value, bytes) else json.dumps(value).encode()
    return list(one.parse(Received(topic, payload, NOW_NS)))


def reasons(found: list[Measurement | Dropped]) -> list[Drop]:
    return [one.reason for one in found if isinstance(one, Dropped)]


def fields(found: list[Measurement | Dropped]) -> list[dict[str, Any]]:
    return [one.fields for one in found if isinstance(one, Measurement)]


def distances(*pairs: tuple[int, int], kind: int = 1) -> str:
    position = struct.pack("<iiiB", 1000, 2000, 0, 80) if kind == 2 else b""
    blob = bytes([kind]) + position + bytes([len(pairs)])
    return base64.b64encode(blob + b"".join(struct.pack("<HIB", anchor, mm, 100) for anchor, mm in pairs)).decode()


@pytest.mark.parametrize("kind", [1, 2])
@pytest.mark.parametrize("topic", ["dwm/node/9a28/uplink/data", "leaps/0001/node/uplink/data/9a28"])
def test_ranges_in_the_user_data_of_a_decawave_tag_are_read(topic: str, kind: int) -> None:
    value = {"data": distances((0x022E, 7940), (0x9280, 3380), kind=kind), "timestamp": "1679494411479191"}
    found = parsed(Decawave(), topic, value)
    t_ns = 1_679_494_411_479_191_000
    assert found == [
        Measurement("9A28", "range", {"anchor": "022E", "range_m": 7.94, "t_ns": t_ns}),
        Measurement("9A28", "range", {"anchor": "9280", "range_m": 3.38, "t_ns": t_ns}),
    ]


def test_a_decawave_message_without_a_time_has_that_of_its_arrival() -> None:
    found = parsed(Decawave(), "dwm/node/9a28/uplink/data", {"data": distances((1, 1000)), "overwrite": False})
    assert [one["t_ns"] for one in fields(found)] == [NOW_NS]


def test_positions_of_a_decawave_gateway_are_counted_and_explained() -> None:
    position = {"position": {"x": 1.5, "y": 2.5, "z": 0.1, "quality": 80}, "superFrameNumber": 116}
    (dropped,) = parsed(Decawave(), "dwm/node/9a28/uplink/location", position)
    assert isinstance(dropped, Dropped)
    assert dropped.reason is Drop.POSITION_ONLY
    assert "user data" in dropped.detail


def test_the_status_of_a_decawave_node_is_no_error() -> None:
    assert parsed(Decawave(), "dwm/node/0f07/uplink/status", {"present": True, "batt": 100}) == []


@pytest.mark.parametrize(
    "value", [{"data": "AAAA"}, {"data": "no base64!"}, {"data": ""}, {"data": distances((1, 1))[:-4]}, {}, [], 1]
)
def test_other_user_data_are_not_understood(value: object) -> None:
    assert reasons(parsed(Decawave(), "dwm/node/9a28/uplink/data", value)) == [Drop.NOT_UNDERSTOOD]


def test_every_gyroscope_reading_of_a_phone_becomes_a_sample_once() -> None:
    phone, found = SensorLogger("sensor-logger/+"), []
    sensors = {
        "gyroscope": lambda _: (0.1, 0.2, 0.3),
        "accelerometer": lambda _: (1.0, 2.0, 0.0),
        "gravity": lambda _: (0.0, 0.0, G),
        "magnetometer": lambda _: (10.0, 20.0, -40.0),
    }
    for body in recording(10, sensors):
        found += parsed(phone, "sensor-logger/cart", body)
    samples = fields(found)
    assert len(samples) >= 990
    assert len({sample["t_ns"] for sample in samples}) == len(samples)
    assert [sample["t_ns"] for sample in samples] == sorted(sample["t_ns"] for sample in samples)
    assert samples[500]["acc"] == pytest.approx([2.0, -1.0, G])
    assert samples[500]["gyro"] == pytest.approx([0.2, -0.1, 0.3])
    assert samples[500]["mag"] == pytest.approx([20.0, -10.0, -40.0])
    assert {one.tag for one in found if isinstance(one, Measurement)} == {"cart"}


def test_the_battery_of_a_phone_is_reported_as_its_health() -> None:
    phone = SensorLogger("sensor-logger")
    levels: tuple[Any, ...] = (
        {"batteryLevel": 0.53, "batteryState": "unplugged"},
        {"batteryLevel": True},
        {"batteryLevel": -1},
        {},
        [0.5],
    )
    found = [
        one
        for number, values in enumerate(levels)
        for one in parsed(phone, "sensor-logger", message(number, [{"name": "battery", "time": 1, "values": values}]))
    ]
    assert [one for one in found if isinstance(one, Measurement)] == [
        Measurement("phone", "health", {"battery_fraction": 0.53})
    ]


def test_the_readings_of_a_phone_are_interpolated() -> None:
    phone = SensorLogger("sensor-logger")
    readings = [
        reading("totalacceleration", NOW_NS, (0.0, 0.0, 9.0)),
        reading("gyroscope", NOW_NS + 5 * MS, (0.0, 0.0, 0.0)),
        reading("totalacceleration", NOW_NS + 20 * MS, (0.0, 4.0, 9.0)),
    ]
    (sample,) = fields(parsed(phone, "sensor-logger", message(0, readings)))
    assert sample["acc"] == pytest.approx([1.0, 0.0, 9.0])


def test_a_phone_without_an_acceleration_is_told_which_sensors_to_switch_on() -> None:
    phone = SensorLogger("sensor-logger")
    found = [
        one
        for body in recording(4, {"gyroscope": lambda _: (0.0, 0.0, 0.0)})
        for one in parsed(phone, "sensor-logger", body)
    ]
    assert reasons(found) == [Drop.NO_MOTION] * 2
    assert isinstance(found[-1], Dropped)
    assert "switch on Total Acceleration (Android) or Accelerometer and Gravity (iPhone)" in found[-1].detail


def test_a_message_of_a_phone_that_comes_twice_counts_once() -> None:
    phone = SensorLogger("sensor-logger")
    [body] = recording(1, ANDROID)
    assert len(parsed(phone, "sensor-logger", body)) == 99
    assert reasons(parsed(phone, "sensor-logger", body)) == [Drop.DUPLICATE]


def test_a_message_of_a_phone_that_never_comes_is_waited_for_two_seconds() -> None:
    phone = SensorLogger("sensor-logger")
    first, _, third = recording(3, ANDROID)
    assert len(parsed(phone, "sensor-logger", first)) == 99
    assert parsed(phone, "sensor-logger", third) == []
    assert list(phone.overdue(NOW_NS + 1_000 * MS)) == []
    assert len(fields(list(phone.overdue(NOW_NS + 2_001 * MS)))) > 90


def test_an_iphone_has_the_same_samples_as_over_http_with_or_without_standardised_frames() -> None:
    def samples(sign: float, signs: Signs = Signs.AUTO) -> list[dict[str, Any]]:
        sensors: dict[str, Value] = {
            "gyroscope": lambda _: (0.0, 0.0, 0.1),
            "accelerometer": lambda _: (sign, 0.0, 0.0),
            "gravity": lambda _: (0.0, 0.0, sign * G),
        }
        [body] = recording(1, sensors)
        return fields(parsed(SensorLogger("sensor-logger", signs), "sensor-logger", body))

    assert samples(-1.0) == samples(1.0) == samples(-1.0, Signs.IOS)
    assert samples(-1.0)[0]["acc"] == pytest.approx([0.0, -1.0, G])
    assert samples(-1.0, Signs.ANDROID)[0]["acc"] == pytest.approx([0.0, 1.0, -G])


def test_a_phone_that_stands_upright_is_not_published_before_its_sign_is_known() -> None:
    phone = SensorLogger("sensor-logger")
    sensors: dict[str, Value] = {
        "gyroscope": lambda _: (0.0, 0.0, 0.0),
        "accelerometer": lambda _: (0.0, 0.0, 0.0),
        "gravity": lambda _: (0.0, -G, 0.0),
    }
    found = [one for body in recording(4, sensors) for one in parsed(phone, "sensor-logger", body)]
    assert reasons(found) == [Drop.SIGN_UNKNOWN] * 4
    assert fields(found) == []


def test_readings_that_are_not_numbers_are_named_with_their_sensor() -> None:
    phone = SensorLogger("sensor-logger")
    readings = [reading("totalacceleration", NOW_NS, (0.0, 0.0, G)), reading("gyroscope", NOW_NS, (math.inf, 0.0, 0.0))]
    found = parsed(phone, "sensor-logger", message(0, readings))
    assert reasons(found) == [Drop.NO_MOTION, Drop.DAMAGED]
    assert all(isinstance(one, Dropped) and "readings of Gyroscope are not numbers" in one.detail for one in found)


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["data", "payload", "deviceId", "messageId", "name", "time", "values", "x", "y", "z", "anchors"]
            )
            | st.text(max_size=3),
            inner,
            max_size=5,
        )
    ),
    max_leaves=12,
)


@given(payload=st.binary(max_size=60) | _JSON.map(lambda value: json.dumps(value).encode()))
def test_no_payload_ends_a_format(payload: bytes) -> None:
    for one, topic in (
        (Decawave(), "dwm/node/9a28/uplink/data"),
        (Decawave(), "a/b/node/uplink"),
        (SensorLogger("sensor-logger"), "sensor-logger"),
    ):
        list(one.parse(Received(topic, payload, NOW_NS)))
