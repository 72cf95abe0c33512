"""`dropanchor-tag mqtt` with a real broker: what devices publish there becomes samples of tags."""

import base64
import json
import struct
import subprocess
import time
from pathlib import Path

import pytest

from dropanchor_schemas.wire import anchor_number
from dropanchor_tag_client.cli import main
from support.certificate import self_signed
from support.listening import ReceivedFrames, listening
from support.mosquitto import mosquitto, needs_mosquitto
from support.mqtt_bridge import bridge, field_or_skip, publish, wait_for_line
from support.patience import PATIENCE_S
from support.zenoh_router import wait_until

pytestmark = needs_mosquitto

DISTANCES = base64.b64encode(b"\x01\x01" + struct.pack("<HIB", 0x022E, 7940, 100)).decode()
RULES = """
[[rule]]
topic = "plant/+/uwb"
tag = "{1}"
kind = "range"
fields = { anchor = "id", range_m = "m" }
"""


def ranges(heard: ReceivedFrames) -> list[tuple[str, int, float]]:
    found = zip(heard.keys, heard.frames, strict=True)
    return [(key.split("/")[4], one.anchor, round(one.range_m, 3)) for key, frame in found for one in frame.ranges]


def test_ranges_of_a_decawave_gateway_and_of_a_template_are_published(router_endpoint: str, tmp_path: Path) -> None:
    (tmp_path / "rules.toml").write_text(RULES)
    with (
        mosquitto(tmp_path) as broker,
        listening(router_endpoint) as heard,
        bridge(
            *(router_endpoint, f"127.0.0.1:{broker.port}", "--decawave", "--template", str(tmp_path / "rules.toml")),
            *("--name", "022E=yard", "--tag-prefix", "t-"),
        ) as process,
        broker.publisher() as client,
    ):
        wait_for_line(process, "connected")
        publish(client, "dwm/node/9a28/uplink/data", {"data": DISTANCES})
        publish(client, "plant/hall/uwb", {"id": 3, "m": 2.5})
        expected = {("t-hall", 3, 2.5), ("t-9A28", anchor_number("yard"), 7.94)}
        wait_until(lambda: expected <= set(ranges(heard)))


@pytest.mark.parametrize(
    ("name", "topic", "expected"),
    [
        ("espresense", "espresense/devices/badge1/kitchen", [("badge1", anchor_number("kitchen"), 3.21)]),
        ("makerfabs", "uwb/mf1", [("mf1", 1, 3.42), ("mf1", 7, 5.1)]),
        ("tasmota_uwb", "tele/tasu/SENSOR", [("tasu", 1, 2.345), ("tasu", 7, 1.872)]),
    ],
)
def test_rules_read_what_devices_publish(
    router_endpoint: str, tmp_path: Path, name: str, topic: str, expected: list[tuple[str, int, float]]
) -> None:
    rules, payload = field_or_skip(f"{name}.toml"), field_or_skip(f"{name}__{topic.replace('/', '_')}.json")
    with (
        mosquitto(tmp_path) as broker,
        listening(router_endpoint) as heard,
        bridge(router_endpoint, f"127.0.0.1:{broker.port}", "--template", str(rules)) as process,
        broker.publisher() as client,
    ):
        wait_for_line(process, "connected")
        publish(client, topic, payload.read_bytes())
        wait_until(lambda: ranges(heard) == expected)


def test_an_object_with_texts_units_and_a_time_of_its_own_becomes_ranges(router_endpoint: str, tmp_path: Path) -> None:
    (tmp_path / "rules.toml").write_text(
        '[[rule]]\ntopic = "uwb/+"\ntag = "{1}"\nkind = "range"\neach = "anchors"\nunit = {range_m = "cm"}\n'
        'fields = {anchor = "{key}", range_m = "{value}", t_ns = "at"}\n'
    )
    with (
        mosquitto(tmp_path) as broker,
        listening(router_endpoint) as heard,
        bridge(router_endpoint, f"127.0.0.1:{broker.port}", "--template", str(tmp_path / "rules.toml")) as process,
        broker.publisher() as client,
    ):
        wait_for_line(process, "connected")
        publish(client, "uwb/cart", {"at": "2026-11-26T08:00:00.250Z", "anchors": {"1": "320", "2": 410, "3": "1e999"}})
        wait_until(lambda: ranges(heard) == [("cart", 1, 3.2), ("cart", 2, 4.1)])
        process.terminate()
        summary = wait_for_line(process, "samples of")
    assert {one.t_ns for frame in heard.frames for one in frame.ranges} == {1_795_680_000_250_000_000}
    assert summary.strip() == "2 samples of 1 tags published; left out: refused 1"


def test_what_the_broker_kept_from_earlier_is_told_and_used_only_if_the_rule_allows_it(
    router_endpoint: str, tmp_path: Path
) -> None:
    (tmp_path / "rules.toml").write_text(RULES + RULES.replace("plant/", "kept/") + "retained = true\n")
    with mosquitto(tmp_path) as broker, broker.publisher() as client, listening(router_endpoint) as heard:
        for topic in ("plant/hall/uwb", "kept/hall/uwb"):
            client.publish(topic, json.dumps({"id": 3, "m": 2.5}), qos=1, retain=True).wait_for_publish(10)
        with bridge(router_endpoint, f"127.0.0.1:{broker.port}", "--template", str(tmp_path / "rules.toml")) as process:
            said = wait_for_line(process, "left out: retained 1")
            client.publish("plant/hall/uwb", json.dumps({"id": 3, "m": 4.5}), qos=1, retain=True).wait_for_publish(10)
            wait_until(lambda: ranges(heard) == [("hall", 3, 2.5), ("hall", 3, 4.5)])
            process.terminate()
            summary = wait_for_line(process, "samples of")
    assert "plant/hall/uwb: the broker kept it, and nobody knows how old it is. retained = true in the rule" in said
    assert summary.strip() == "2 samples of 1 tags published; left out: retained 1"


def test_bad_payloads_are_named_and_counted_and_harm_no_other_tag(router_endpoint: str, tmp_path: Path) -> None:
    with (
        mosquitto(tmp_path) as broker,
        listening(router_endpoint) as heard,
        bridge(router_endpoint, f"127.0.0.1:{broker.port}", "--decawave") as process,
        broker.publisher() as client,
    ):
        wait_for_line(process, "connected")
        for payload in (b"\xff\xfe", b"{", b"[" * 100_000, {"data": "?"}, {"data": None}, 7):
            publish(client, "dwm/node/bad/uplink/data", payload)
        publish(client, "dwm/node/9a28/uplink/location", {"position": {"x": 1, "y": 2, "z": 3, "quality": 50}})
        publish(client, f"dwm/node/{'n' * 90}/uplink/data", {"data": DISTANCES})
        publish(client, "dwm/node/9a28/uplink/data", {"data": DISTANCES})
        wait_until(lambda: ranges(heard) == [("9A28", anchor_number("022E"), 7.94)])
        process.terminate()
        summary = wait_for_line(process, "samples of")
    assert summary.strip() == (
        "1 samples of 1 tags published; left out: not_json 3, not_understood 3, position_only 1, tag_invalid 1"
    )


def test_a_flood_of_bad_payloads_is_told_once_per_second(router_endpoint: str, tmp_path: Path) -> None:
    with (
        mosquitto(tmp_path) as broker,
        bridge(router_endpoint, f"127.0.0.1:{broker.port}", "--decawave") as process,
        broker.publisher() as client,
    ):
        wait_for_line(process, "connected")
        began_s = time.monotonic()
        for _ in range(2000):
            client.publish("dwm/node/bad/uplink/data", b"{")
        publish(client, "dwm/node/bad/uplink/data", b"{")
        wait_for_line(process, "left out: not_json")
        process.terminate()
        _, rest = process.communicate(timeout=PATIENCE_S)
    assert rest.count("left out: not_json") <= time.monotonic() - began_s + 2


def test_the_bridge_comes_back_with_the_broker(router_endpoint: str, tmp_path: Path) -> None:
    with (
        mosquitto(tmp_path) as broker,
        listening(router_endpoint) as heard,
        bridge(router_endpoint, f"127.0.0.1:{broker.port}", "--decawave") as process,
    ):
        wait_for_line(process, "connected")
        broker.stop()
        wait_for_line(process, "the connection broke")
        broker.start()
        wait_for_line(process, "connected")
        with broker.publisher() as client:
            publish(client, "dwm/node/9a28/uplink/data", {"data": DISTANCES})
            wait_until(lambda: ranges(heard))


def test_tls_and_a_password_are_used_and_a_foreign_certificate_is_refused(
    router_endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DROPANCHOR_MQTT_PASSWORD", "secret")
    certificate, key = self_signed(tmp_path)
    (tmp_path / "other").mkdir()
    foreign, _ = self_signed(tmp_path / "other")
    passwords = tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-b", "-c", str(passwords), "secret", "secret"], check=True)
    options = (f"certfile {certificate}", f"keyfile {key}", f"password_file {passwords}", "allow_anonymous false")
    with mosquitto(tmp_path, *options) as broker, listening(router_endpoint) as heard:
        url, user = f"mqtts://127.0.0.1:{broker.port}", ("--mqtt-user", "secret")
        with bridge(router_endpoint, url, "--decawave", "--mqtt-ca", str(foreign), *user) as process:
            assert "its certificate is not trusted" in wait_for_line(process, url)
        with bridge(router_endpoint, url, "--decawave", "--mqtt-ca", str(certificate)) as process:
            assert "Check --mqtt-user" in wait_for_line(process, "refuses")
        with (
            bridge(router_endpoint, url, "--decawave", "--mqtt-ca", str(certificate), *user) as process,
            broker.publisher(certificate, "secret") as client,
        ):
            wait_for_line(process, "connected")
            publish(client, "dwm/node/9a28/uplink/data", {"data": DISTANCES})
            wait_until(lambda: ranges(heard))


def test_a_rule_with_an_unknown_place_ends_the_program_and_lists_what_is_known(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "rules.toml").write_text(RULES.replace('"id"', '"{2}"'))
    assert main(["mqtt", "localhost", "--template", str(tmp_path / "rules.toml")]) == 2
    assert (
        "rule 1: fields.anchor: there is no {2}; known are {1} (what each + stands for), {topic[0]} to {topic[2]}, "
        "{value} (the payload), and a path in the payload, such as {device.id}"
    ) in capsys.readouterr().err
