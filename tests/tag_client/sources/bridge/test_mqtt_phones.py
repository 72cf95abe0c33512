"""`dropanchor-tag mqtt` with a real broker to which the app Sensor Logger publishes."""

from pathlib import Path

import pytest

from support.listening import listening
from support.mosquitto import mosquitto, needs_mosquitto
from support.mqtt_bridge import bridge, field_or_skip, publish, wait_for_line
from support.sensor_logger import G, recording
from support.zenoh_router import free_port, wait_until

pytestmark = needs_mosquitto


def test_a_phone_publishes_over_websocket_and_its_tag_is_in_the_topic(router_endpoint: str, tmp_path: Path) -> None:
    sensors = {"gyroscope": lambda _: (0.0, 0.0, 0.5), "totalacceleration": lambda _: (0.0, 0.0, G)}
    socket = free_port()
    with (
        mosquitto(tmp_path, "allow_anonymous true", f"listener {socket} 127.0.0.1", "protocol websockets") as broker,
        listening(router_endpoint) as heard,
        bridge(router_endpoint, f"ws://127.0.0.1:{socket}", "--sensor-logger", "sensor-logger/+") as process,
        broker.publisher() as client,
    ):
        wait_for_line(process, "connected")
        for body in recording(3, sensors):
            publish(client, "sensor-logger/cart-1", body)
        wait_until(lambda: sum(len(frame.imu) for frame in heard.frames) >= 290)
    assert {key.split("/")[4] for key in heard.keys} == {"cart-1"}
    assert heard.frames[0].imu[0].acc == pytest.approx((0.0, 0.0, G))


def test_an_iphone_is_published_the_right_way_up(router_endpoint: str, tmp_path: Path) -> None:
    messages = field_or_skip("sensor_logger_iphone.jsonl").read_bytes().splitlines()
    with (
        mosquitto(tmp_path) as broker,
        listening(router_endpoint) as heard,
        bridge(router_endpoint, f"127.0.0.1:{broker.port}", "--sensor-logger", "sensor-logger/+") as process,
        broker.publisher() as client,
    ):
        wait_for_line(process, "connected")
        for body in messages:
            publish(client, "sensor-logger/phone", body)
        wait_until(lambda: sum(len(frame.imu) for frame in heard.frames) >= 100)
    assert {round(one.acc[2], 3) for frame in heard.frames for one in frame.imu} == {round(G, 3)}


def test_a_phone_whose_sign_cannot_be_known_is_told_and_not_published(router_endpoint: str, tmp_path: Path) -> None:
    upright = {
        "gyroscope": lambda _: (0.0, 0.0, 0.5),
        "accelerometer": lambda _: (0.0, 0.0, 0.0),
        "gravity": lambda _: (0.0, -G, 0.0),
    }
    with (
        mosquitto(tmp_path) as broker,
        listening(router_endpoint) as heard,
        broker.publisher() as client,
    ):
        where = (router_endpoint, f"127.0.0.1:{broker.port}", "--sensor-logger", "sensor-logger")
        with bridge(*where) as process:
            wait_for_line(process, "connected")
            for body in recording(3, upright):
                publish(client, "sensor-logger", body)
            assert "Lay the phone flat with its screen up" in wait_for_line(process, "sign_unknown")
            process.terminate()
            assert wait_for_line(process, "samples of").startswith("0 samples of 0 tags published; left out: sign_unk")
        assert heard.frames == []
        with bridge(*where, "--signs", "ios") as process:
            wait_for_line(process, "connected")
            for body in recording(3, upright):
                publish(client, "sensor-logger", body)
            wait_until(lambda: heard.frames)
    assert heard.frames[0].imu[0].acc == pytest.approx((G, 0.0, 0.0))
