"""What the formats make of messages: pure functions of topic and payload."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_tag_client.sources.bridge.decawave import Decawave
from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Format, Measurement
from dropanchor_tag_client.sources.bridge.sensor_logger import SensorLogger
from dropanchor_tag_client.sources.bridge.template import Template, TemplateError, matches
from support.sensor_logger import G, message, reading, recording

NOW_NS = 1_800_000_000_000_000_000
MS = 1_000_000
RULES = """
[[rule]]
topic = "plant/+/uwb"
tag = "{1}-{device.id}"
kind = "range"
each = "anchors"
time_unit = "ms"
fields = { anchor = "id", range_m = "cm", t_ns = "at" }
scale = { range_m = 0.01 }

[[rule]]
topic = "imu/#"
tag = "cart"
kind = "imu"
fields = { acc = ["ax", "ay", "az"], gyro = "g" }
scale = { acc = 9.80665, gyro = 0.5 }

[[rule]]
topic = "radar"
tag = "{who}"
kind = "range"
time_unit = "s"
fields = { anchor = "=yard", range_m = "list.1.d", t_ns = "t" }
"""


@pytest.fixture
def template(tmp_path: Path) -> Template:
    (tmp_path / "rules.toml").write_text(RULES)
    return Template(tmp_path / "rules.toml")


def parsed(one: Format, topic: str, value: Any) -> list[Measurement | Dropped]:
    payload = value if isinstance(value, bytes) else json.dumps(value).encode()
    return list(one.parse(topic, payload, NOW_NS))


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

    def found_in(values: object) -> list[Measurement | Dropped]:
        reading = {"name": "battery", "time": 1, "values": values}
        message = {"messageId": 1, "sessionId": "s", "deviceId": "p", "payload": [reading]}
        return [found for found in phone.parse("sensor-logger", json.dumps(message).encode(), 0) if found[0] == "p"]

    assert found_in({"batteryLevel": 0.53, "batteryState": "unplugged"}) == [
        Measurement("p", "health", {"battery_fraction": 0.53})
    ]
    for values in ({"batteryLevel": True}, {"batteryLevel": "full"}, {}, [0.5]):
        assert found_in(values) == []


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
    assert set(reasons(found)) == {Drop.UNPAIRED}


def test_a_message_of_a_phone_that_comes_twice_counts_once() -> None:
    phone = SensorLogger("sensor-logger")
    assert parsed(phone, "sensor-logger", message(3, [])) == []
    assert reasons(parsed(phone, "sensor-logger", message(3, []))) == [Drop.DUPLICATE]


def test_a_template_finds_tag_anchor_range_and_time(template: Template) -> None:
    value = {"device": {"id": 7}, "anchors": [{"id": "A", "cm": 321, "at": 1_700_000_000_000}, {"id": 2, "cm": 5}]}
    found = parsed(template, "plant/hall/uwb", value)
    assert found[0] == Measurement(
        "hall-7", "range", {"anchor": "A", "range_m": pytest.approx(3.21), "t_ns": 1_700_000_000_000 * MS}
    )
    assert reasons(found) == [Drop.NOT_UNDERSTOOD]


def test_the_time_may_stand_beside_a_list_but_an_anchor_may_not(template: Template) -> None:
    value = {
        "device": {"id": 7},
        "id": "not the anchor",
        "at": 1_700_000_000_000,
        "anchors": [{"id": 2, "cm": 5}, {"cm": 6}],
    }
    found = parsed(template, "plant/hall/uwb", value)
    assert fields(found) == [{"anchor": 2, "range_m": pytest.approx(0.05), "t_ns": 1_700_000_000_000 * MS}]
    assert reasons(found) == [Drop.NOT_UNDERSTOOD]


def test_a_template_reads_vectors_constants_and_indices(template: Template) -> None:
    (imu,) = fields(parsed(template, "imu/left/front", {"ax": 0, "ay": 0, "az": 1, "g": [1, 2, 3]}))
    assert imu == {"t_ns": NOW_NS, "acc": [0, 0, 9.80665], "gyro": [0.5, 1.0, 1.5]}
    (one,) = fields(parsed(template, "radar", {"who": "x", "t": 1.5, "list": [{}, {"d": 4.5}]}))
    assert one == {"anchor": "yard", "range_m": 4.5, "t_ns": 1_500_000_000}


def test_the_rules_in_the_documentation_work(tmp_path: Path) -> None:
    text = (Path(__file__).parents[4] / "tag_client" / "docs" / "devices.md").read_text()
    (tmp_path / "rules.toml").write_text(text.split("```toml\n")[1].split("```")[0])
    documented = Template(tmp_path / "rules.toml")
    value = {"device": {"id": 7}, "anchors": [{"id": "A", "cm": 321, "at": 5}]}
    assert fields(parsed(documented, "plant/hall/uwb", value)) == [
        {"anchor": "A", "range_m": pytest.approx(3.21), "t_ns": 5 * MS}
    ]
    assert fields(parsed(documented, "imu/a", {"ax": 0, "ay": 0, "az": 1, "g": [0, 0, 1]}))


@pytest.mark.parametrize(
    ("topic", "value"),
    [
        ("plant/hall/uwb", {"device": {"id": 7}, "anchors": 5}),
        ("plant/hall/uwb", {"anchors": [{"id": 1, "cm": 3, "at": 5}]}),
        ("plant/hall/uwb", {"device": {"id": 7}, "anchors": [{"id": 1, "cm": "far", "at": 5}]}),
        ("imu/x", {"ax": 0}),
        ("radar", {"who": "x", "t": "soon", "list": [1, {"d": 2}]}),
        ("radar", 5),
    ],
)
def test_what_a_template_cannot_find_is_named(template: Template, topic: str, value: object) -> None:
    assert reasons(parsed(template, topic, value)) == [Drop.NOT_UNDERSTOOD]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "has no table"),
        ("[[rule]]\ntopic = 1\n", "tag is missing"),
        (RULES.replace('"range"', '"rang"'), "kind is 'rang'"),
        (RULES.replace("anchor = ", "anker = "), "fields are anchor, range_m"),
        (RULES.replace("{1}", "{2}"), "names a + that the topic does not have"),
        (RULES.replace('"ms"', '"h"'), "time_unit is one of"),
        (RULES.replace("each", "every"), "there is no key 'every'"),
        (RULES + "]", "rules.toml"),
    ],
)
def test_a_wrong_file_of_rules_is_named_with_the_rule(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "rules.toml").write_text(text)
    with pytest.raises(TemplateError, match=why.replace("+", r"\+")):
        Template(tmp_path / "rules.toml")


@pytest.mark.parametrize(
    ("pattern", "topic", "expected"),
    [
        ("a/b", "a/b", True),
        ("a/+", "a/b", True),
        ("a/+", "a/b/c", False),
        ("a/#", "a/b/c", True),
        ("a/#", "a", True),
        ("a/#", "b/a", False),
        ("+/b", "a/c", False),
    ],
)
def test_a_filter_matches_topics_as_in_mqtt(pattern: str, topic: str, expected: bool) -> None:
    assert matches(pattern, topic) is expected


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
def test_no_payload_ends_a_format(payload: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    rules = tmp_path_factory.getbasetemp() / "rules.toml"
    rules.write_text(RULES)
    for one, topic in (
        (Decawave(), "dwm/node/9a28/uplink/data"),
        (Decawave(), "a/b/node/uplink"),
        (SensorLogger("sensor-logger"), "sensor-logger"),
        (Template(rules), "plant/hall/uwb"),
        (Template(rules), "radar"),
    ):
        list(one.parse(topic, payload, NOW_NS))
