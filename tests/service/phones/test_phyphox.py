"""Recordings of phyphox from posted messages to samples: every reading once, in order, with the right time."""

import json
import math
import random

import pytest

from dropanchor_service.phones.phyphox import Message, parse
from dropanchor_service.phones.phyphox_session import PhyphoxSession
from dropanchor_tag_client.sources.phones.session import WAIT_S
from support.phone import Phone
from support.phyphox import Value, event, message, recording
from support.sensor_logger import G, Vector

START_S = 1_800_000_000.125
START_NS = 1_800_000_000_125_000_000
START = [event("START", 0.0, START_S)]


def make_phone() -> Phone[Message]:
    return Phone(parse, lambda _: PhyphoxSession())


def turning(t: float) -> Vector:
    return 0.0, 0.0, math.sin(t)


SENSORS: dict[str, Value] = {
    "gyroscope": turning,
    "accelerometer": lambda _: (0.0, 1.0, G),
    "magnetometer": lambda _: (20.0, 0.0, -40.0),
}


def at_rest(*times: float) -> dict[str, list[tuple[float, Vector]]]:
    return {
        "gyroscope": [(t, (0.0, 0.0, 0.0)) for t in times],
        "accelerometer": [(t, (0.0, 0.0, G)) for t in times],
    }


def test_ten_minutes_at_100_hz_out_of_order_and_repeated_lose_no_reading_and_use_none_twice() -> None:
    phone, chance = make_phone(), random.Random(5)
    messages = list(recording(600, SENSORS, START_S))
    places = [(index + chance.uniform(0.0, 5.0), body) for index, body in enumerate(messages)]
    places += [(index + chance.uniform(0.0, 9.0), body) for index, body in list(enumerate(messages))[::7]]
    for _, body in sorted(places, key=lambda place: place[0]):
        phone.post(body)
        phone.now_s += 0.175  # 3,429 messages in 600 s
    times = [sample.t_ns for sample in phone.samples]
    assert times == [
        START_NS + (index + 1) * 10_000_000 for index in range(59_999)
    ]  # the last one has no acceleration after it
    for sample in phone.samples[::997]:
        assert sample.acc == pytest.approx((1.0, 0.0, G), rel=1e-6)
        assert sample.mag == pytest.approx((0.0, -20.0, -40.0), rel=1e-6)
        assert sample.gyro[2] == pytest.approx(turning((sample.t_ns - START_NS) * 1e-9)[2], abs=1e-6)
    assert [frame.sequence for frame in phone.frames] == list(range(len(phone.frames)))


def test_messages_that_overlap_give_every_reading_once() -> None:
    phone = make_phone()
    times = [round(0.01 * index, 3) for index in range(1, 61)]
    for begin in (0, 10, 20, 30):
        phone.post(message(START, START_S, at_rest(*times[begin : begin + 30])))
    assert [round((sample.t_ns - START_NS) * 1e-9, 3) for sample in phone.samples] == times


def test_a_pause_moves_the_times_after_it_and_a_cleared_experiment_is_a_new_one() -> None:
    phone = make_phone()
    phone.post(message(START, START_S + 1, at_rest(0.98, 0.99)))
    resumed = [*START, event("PAUSE", 1.0, START_S + 1.0), event("START", 1.0, START_S + 61.0)]
    assert phone.intake.post("anna", message(resumed, START_S + 62, {})).waiting == 0
    phone.post(message(resumed, START_S + 62, at_rest(1.01, 1.02)))
    phone.now_s += WAIT_S
    phone.intake.release_overdue()
    cleared = [event("START", 0.0, START_S + 100.0)]
    phone.post(message(cleared, START_S + 101, at_rest(0.01)))
    times = [round((sample.t_ns - START_NS) * 1e-9, 3) for sample in phone.samples]
    assert times == [0.98, 0.99, 61.01, 61.02, 100.01]
    assert len({frame.boot_id for frame in phone.frames}) == 2


def test_a_phone_without_a_magnetometer_sends_samples_without_a_field() -> None:
    phone = make_phone()
    assert phone.post(message(START, START_S, at_rest(0.05, 0.06))) == 2
    assert {sample.mag for sample in phone.samples} == {None}


def test_readings_that_make_no_sense_are_counted_and_harm_no_others() -> None:
    phone = make_phone()
    readings = at_rest(0.05, 0.06, 0.07)
    damaged = json.loads(message(START, START_S, readings))
    damaged["gyroscope_x"][1] = None  # what the app sends for a value that is not finite
    damaged["accelerometer_z"][0] = "9.81"
    damaged["accelerometer_t"].append(-1)
    outcome = phone.intake.post("anna", json.dumps(damaged).encode())
    assert outcome.damaged == 3
    assert [round((sample.t_ns - START_NS) * 1e-9, 3) for sample in phone.samples] == [0.07]


def test_an_experiment_that_has_not_begun_or_pauses_sends_nothing_and_is_welcome() -> None:
    phone = make_phone()
    for body in (message([], START_S, {}), message(START, START_S, at_rest())):
        assert phone.post(body) == 0
    assert not phone.counted


def test_a_barometer_is_passed_on_in_pascals_once_and_what_is_no_number_is_damaged() -> None:
    phone = make_phone()
    content = json.loads(message(START, START_S + 1, at_rest(0.1, 0.11)))
    body = json.dumps(content | {"pressure_t": [0.05, 0.15, 0.25], "pressure_x": [1013.25, None, 1013.5]}).encode()
    outcomes = [phone.intake.post("anna", body) for _ in range(2)]
    assert [one.damaged for one in outcomes] == [1, 1]
    pressures = [sample[:2] for frame in phone.frames for sample in frame.pressures]
    assert pressures == [(START_NS + 50_000_000, 101_325.0), (START_NS + 250_000_000, 101_350.0)]


def test_a_message_of_the_barometer_alone_is_used() -> None:
    phone = make_phone()
    content = json.loads(message(START, START_S + 1, {}))
    phone.post(json.dumps(content | {"pressure_t": [0.05], "pressure_x": [1013.25]}).encode())
    assert [sample.pressure_pa for frame in phone.frames for sample in frame.pressures] == [101_325.0]
