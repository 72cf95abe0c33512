"""Messages of phyphox and of Sensor Logger: each counts once, none waits for ever, and what is none is refused."""

import json
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from dropanchor_tag_client.sources.phones.readings import PhoneError
from dropanchor_tag_client.sources.phones.session import MAX_WAITING, WAIT_S
from service.phones import test_phyphox, test_sensor_logger
from support import phyphox, sensor_logger
from support.phone import Phone
from support.phyphox import event


class App(NamedTuple):
    """messages: the first of a recording, each with `samples`."""

    make_phone: Callable[[], Phone[Any]]
    messages: Callable[[int], list[bytes]]
    samples: int


PHYPHOX = App(
    test_phyphox.make_phone,
    lambda count: list(phyphox.recording(0.2 * count, test_phyphox.SENSORS, test_phyphox.START_S)),
    20,
)
SENSOR_LOGGER = App(
    test_sensor_logger.make_phone, lambda count: list(sensor_logger.recording(count, test_sensor_logger.ANDROID)), 100
)
both = pytest.mark.parametrize("app", [PHYPHOX, SENSOR_LOGGER], ids=["phyphox", "sensor_logger"])


@both
def test_a_message_that_comes_twice_is_told_and_used_once(app: App) -> None:
    phone, [body] = app.make_phone(), app.messages(1)
    assert phone.post(body) == len(phone.samples) >= app.samples - 2
    before = len(phone.samples)
    assert phone.intake.post("anna", body).duplicate
    assert len(phone.samples) == before


@both
def test_a_message_that_never_comes_is_given_up_after_a_while_and_used_when_it_comes_after_all(app: App) -> None:
    phone = app.make_phone()
    first, second, third = app.messages(3)
    phone.post(first)
    assert phone.intake.post("anna", third).waiting == 1
    phone.intake.release_overdue()
    assert len(phone.samples) <= app.samples
    phone.now_s += WAIT_S
    phone.intake.release_overdue()
    assert len(phone.samples) >= 1.9 * app.samples
    assert phone.post(second) >= 0.9 * app.samples
    times = [sample.t_ns for sample in phone.samples]
    assert len(times) == len(set(times)) >= 2.9 * app.samples


@both
def test_no_more_messages_wait_than_are_allowed(app: App) -> None:
    phone = app.make_phone()
    waiting = [phone.intake.post("anna", body).waiting for body in app.messages(MAX_WAITING + 2)[1:]]
    assert max(waiting) == MAX_WAITING
    assert waiting[-1] == 0


@both
def test_a_service_that_hears_a_recording_from_its_middle_on_does_not_wait_for_its_beginning(app: App) -> None:
    assert app.make_phone().post(app.messages(20)[10]) >= app.samples - 1


@pytest.mark.parametrize(
    ("app", "content", "sentence"),
    [
        (PHYPHOX, b"\xff", "is not JSON"),
        (PHYPHOX, b"[" * 100_000, "is not JSON"),
        (PHYPHOX, b"[]", "load it again"),
        (PHYPHOX, b"{}", "load it again"),
        (PHYPHOX, b'{"time": 5}', "load it again"),
        (PHYPHOX, {"time": {}, "gyroscope_t": 1}, "gyroscope_t is not a list"),
        (PHYPHOX, {"time": {}, "gyroscope_t": [1]}, "names no start"),
        (PHYPHOX, {"time": {"events": [3]}, "gyroscope_t": [1]}, "names no start"),
        (
            PHYPHOX,
            {"time": {"events": [event("START", 0, -1)]}, "gyroscope_t": [1]},
            "has no time",
        ),
        (
            PHYPHOX,
            {"time": {"events": [event("START", 0, 1e300)]}, "gyroscope_t": [1]},
            "has no time",
        ),
        (PHYPHOX, b'{"time": {"events": [{"event": "START"}]}, "gyroscope_t": [1]}', "has no time"),
        (SENSOR_LOGGER, b"", "is not JSON"),
        (SENSOR_LOGGER, b"\xff", "is not JSON"),
        (SENSOR_LOGGER, b"[" * 100_000, "is not JSON"),
        (SENSOR_LOGGER, b"[1]", "is not a JSON object"),
        (SENSOR_LOGGER, b'{"payload": 1}', "payload is not a list"),
        (SENSOR_LOGGER, {"messageId": 0, "payload": [1]}, "sessionId is not"),
        (SENSOR_LOGGER, {"messageId": 0, "sessionId": "", "payload": [1]}, "sessionId is not"),
        (
            SENSOR_LOGGER,
            {"messageId": 0, "sessionId": "x" * 200, "payload": [1]},
            "sessionId is not",
        ),
        (SENSOR_LOGGER, {"messageId": -1, "sessionId": "a", "payload": [1]}, "messageId is not"),
        (SENSOR_LOGGER, {"messageId": True, "sessionId": "a", "payload": [1]}, "messageId is not"),
        (
            SENSOR_LOGGER,
            {"messageId": 2**60, "sessionId": "a", "payload": [1]},
            "messageId is not",
        ),
    ],
)
def test_what_is_no_message_is_refused_with_a_sentence_and_counted(app: App, content: object, sentence: str) -> None:
    phone, body = app.make_phone(), content if isinstance(content, bytes) else json.dumps(content).encode()
    with pytest.raises(PhoneError, match=sentence):
        phone.post(body)
    assert phone.counted == [body]
