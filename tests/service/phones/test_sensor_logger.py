"""Recordings of phones from pushed messages to payloads: every reading once, in order, within limits."""

import json
import math
import random

import pytest

from dropanchor_schemas.wire import ENCODING_JSON
from dropanchor_service.phones.intake import BATTERY_S, SESSIONS_PER_TAG
from dropanchor_tag_client.sources.phones.readings import PhoneError
from dropanchor_tag_client.sources.phones.sensor_logger import Message, parse
from dropanchor_tag_client.sources.phones.session import WAIT_S, Session
from support.phone import Phone
from support.sensor_logger import T_NS, G, Value, Vector, message, reading, recording


def make_phone() -> Phone[Message]:
    return Phone(parse, Session)


def turning(t_ns: int) -> Vector:
    return 0.0, 0.0, math.sin((t_ns - T_NS) * 1e-9)


ANDROID: dict[str, Value] = {
    "gyroscope": turning,
    "totalacceleration": lambda _: (0.0, 0.0, G),
    "magnetometer": lambda _: (20.0, 0.0, -40.0),
}
IOS: dict[str, Value] = {
    "gyroscope": turning,
    "accelerometer": lambda _: (0.0, 0.0, 0.0),
    "gravity": lambda _: (0.0, 0.0, -G),
}


def out_of_order(messages: list[bytes], seed: int) -> list[bytes]:
    """Each message a few places from its own, and every seventh one twice."""
    chance = random.Random(seed)
    places = [(index + chance.uniform(0.0, 5.0), body) for index, body in enumerate(messages)]
    places += [(index + chance.uniform(0.0, 9.0), body) for index, body in list(enumerate(messages))[::7]]
    return [body for _, body in sorted(places, key=lambda place: place[0])]


@pytest.mark.parametrize("sensors", [ANDROID, IOS], ids=["android", "ios"])
def test_ten_minutes_at_100_hz_out_of_order_lose_no_reading_and_use_none_twice(sensors: dict[str, Value]) -> None:
    phone = make_phone()
    taken = 0
    for body in out_of_order(list(recording(600, sensors, batch_ns=200_000_000)), seed=3):
        taken += phone.post(body)
        phone.now_s += 0.175  # 3,429 messages in 600 s
    times = [sample.t_ns for sample in phone.samples]
    every = [T_NS + index * 10_000_000 for index in range(60_000)]
    assert times == every[:-1]  # the last one has no acceleration after it
    assert taken == len(times)
    for sample in phone.samples[::997]:
        assert sample.acc == pytest.approx((0.0, 0.0, G), rel=1e-6)
        assert sample.gyro[2] == pytest.approx(turning(sample.t_ns)[2], abs=1e-6)
    assert [frame.sequence for frame in phone.frames] == list(range(len(phone.frames)))
    assert len({frame.boot_id for frame in phone.frames}) == 1


def test_a_message_that_comes_after_it_was_given_up_is_used_all_the_same_and_with_the_signs_of_the_others() -> None:
    phone = make_phone()
    upright: dict[str, Value] = IOS | {
        "gravity": lambda t_ns: (0.0, 0.0, -G) if t_ns < T_NS + 9 * 10**8 else (0.0, G, 0.0)
    }
    first, second, third = recording(3, upright)
    phone.post(first)
    phone.post(third)
    phone.now_s += WAIT_S
    phone.intake.release_overdue()
    assert phone.post(second) > 90
    times = [sample.t_ns for sample in phone.samples]
    assert len(times) == len(set(times))


def test_a_new_recording_ends_the_wait_of_the_oldest_of_its_tag() -> None:
    phone = make_phone()
    phone.post(message(1, [reading("gyroscope", T_NS, (0, 0, 0)), reading("totalacceleration", T_NS, (0, 0, G))]))
    assert not phone.samples
    for number in range(SESSIONS_PER_TAG):
        phone.post(message(0, [reading("light", T_NS, (0, 0, 0))], session=f"later-{number}"))
    assert len(phone.samples) == 1


def test_a_large_message_fills_several_payloads() -> None:
    phone = make_phone()
    [body] = recording(10, {"gyroscope": turning, "totalacceleration": lambda _: (0, 0, G)}, 400, T_NS, 10_000_000_000)
    assert phone.post(body) == 3998
    assert [len(frame.imu) for frame in phone.frames] == [1000, 1000, 1000, 998]


def test_a_test_of_the_connection_is_welcome() -> None:
    for body in (b"{}", b'{"payload": []}'):
        assert make_phone().post(body) == 0


def test_a_message_of_another_app_is_no_test_of_the_connection() -> None:
    body = b'{"loggingTime": "2026-11-26 08:00:00.000 +0100", "accelerometerAccelerationX": "-0.01"}'
    with pytest.raises(PhoneError, match="fields such as loggingTime, accelerometerAccelerationX, which are not those"):
        make_phone().post(body)


def test_times_as_text_and_values_beside_them_are_understood() -> None:
    phone = make_phone()
    readings = [
        {"name": name, "time": str(T_NS), "x": 0.0, "y": 0.0, "z": z}
        for name, z in (("Gyroscope", 0.0), ("TotalAcceleration", G))
    ]
    assert phone.post(message(0, readings)) == 1


@pytest.mark.parametrize(
    "damage",
    [
        {"time": None},
        {"time": -1},
        {"time": 2**63},
        {"time": "noon"},
        {"time": True},
        {"time": 1e999},
        {"values": None},
        {"values": {"x": 0, "y": 0}},
        {"values": {"x": 0, "y": 0, "z": None}},
        {"values": {"x": 0, "y": 0, "z": math.nan}},
        {"values": {"x": 0, "y": 0, "z": 1e300}},
    ],
)
def test_a_damaged_reading_is_counted_and_harms_no_other(damage: dict[str, object]) -> None:
    phone = make_phone()
    good = [reading("gyroscope", T_NS, (0, 0, 0)), reading("totalacceleration", T_NS, (0, 0, G))]
    bad = [reading("gyroscope", T_NS + 1, (0, 0, 0)) | damage, 17, {"name": ["gyroscope"]}]
    posted = phone.intake.post("anna", message(0, [*bad, *good]))
    assert (posted.samples, posted.damaged) == (1, 1)


def test_the_charge_of_the_battery_is_reported_when_it_changes_and_now_and_then() -> None:
    phone = make_phone()

    def post(number: int, *levels: object) -> None:
        batteries = [{"name": "battery", "time": T_NS, "values": {"batteryLevel": level}} for level in levels]
        t_ns = T_NS + number * 10_000_000
        motion = [reading("gyroscope", t_ns, (0, 0, 0)), reading("totalacceleration", t_ns, (0, 0, G))]
        phone.post(message(number, [*batteries, *motion]))

    for number, levels in enumerate([(0.9, 0.8), (0.8,), (0.79,), (), (-1,), ("full",), (True,)]):
        post(number, *levels)
    post(2, 0.5)  # a repeated message tells nothing
    phone.now_s = BATTERY_S
    post(7, 0.79)
    reports = [json.loads(payload)["battery_fraction"] for _, payload, _ in phone.health]
    assert reports == [0.8, 0.79, 0.79]
    assert {(tag, encoding) for tag, _, encoding in phone.health} == {("anna", ENCODING_JSON)}


def test_a_barometer_is_passed_on_in_pascals_once_and_without_waiting_for_other_sensors() -> None:
    readings = [
        {"name": "barometer", "time": T_NS, "values": {"pressure": 1013.25, "relativeAltitude": 0.5}},
        {"name": "barometer", "time": str(T_NS + 40_000_000), "values": {"pressure": 1013.5, "relativeAltitude": 0.4}},
        {"name": "barometer", "time": T_NS, "values": {"pressure": None}},
        {"name": "barometer", "time": -1, "values": {"pressure": 1013.0}},
    ]
    phone = make_phone()
    for _ in range(2):
        phone.post(message(0, readings))
    pressures = [sample for frame in phone.frames for sample in frame.pressures]
    assert [sample[:2] for sample in pressures] == [(T_NS, 101_325.0), (T_NS + 40_000_000, 101_350.0)]
