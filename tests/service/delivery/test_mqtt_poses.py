"""Poses and zones are on a real MQTT broker: retained, the newest only, and no position but one that is tracked."""

import os
import shutil
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import orjson
import pytest
from paho.mqtt.client import Client, MQTTMessage

from dropanchor_schemas.destinations import MqttPosesDestination
from dropanchor_schemas.site import Georeference, TagSettings
from dropanchor_schemas.zones import Circle, Zone
from dropanchor_service.delivery.mqtt import poses
from dropanchor_service.estimation.columns import State, StateReason
from dropanchor_service.events.drafts import StateKey, StateValue
from dropanchor_service.settings.events import MqttSettings
from service.delivery.test_mqtt import bench_of, secured_broker
from support.delivery import DeliveryBench
from support.mosquitto import Mosquitto, mosquitto, needs_mosquitto
from support.receiver import Receiver, running_receiver
from support.zenoh_router import wait_until

pytestmark = [
    needs_mosquitto,
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),  # paho leaves sockets open
]

STATUS = "dropanchor/yard/status"
versions = pytest.mark.parametrize("version", ["5", "3.1.1"])


@pytest.fixture(autouse=True)
def _fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(poses, "PERIOD_S", 0.02)
    monkeypatch.setattr(poses, "FULL_PAUSE_S", 0.01)


@dataclass
class Heard:
    """What a subscriber got: all payloads by topic, and the latest as JSON."""

    payloads: dict[str, list[bytes]] = field(default_factory=lambda: defaultdict(list))

    def take(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        self.payloads[message.topic].append(bytes(message.payload))

    def last(self, topic: str) -> Any:
        payloads = self.payloads.get(topic)
        return None if not payloads else payloads[-1].decode() if topic == STATUS else orjson.loads(payloads[-1] or "0")

    def tag(self, tag: str) -> Any:
        return self.last(f"dropanchor/yard/tag/{tag}")

    def xs(self, tag: str) -> list[float]:
        return [orjson.loads(payload)["x"] for payload in self.payloads[f"dropanchor/yard/tag/{tag}"]]


@contextmanager
def subscribed(broker: Mosquitto) -> Iterator[Heard]:
    heard = Heard()
    secured = (broker.folder / "broker.pem", "yard") if (broker.folder / "broker.pem").exists() else ()
    with broker.publisher(*secured) as client:
        client.on_message = heard.take
        client.subscribe("#", 1)
        yield heard


def on(broker: Mosquitto, version: str = "5", timeout_s: float = 60.0) -> DeliveryBench:
    mqtt = {"server": "127.0.0.1", "port": broker.port, "tls": False, "version": version}
    return DeliveryBench(mqtt=MqttSettings.model_validate(mqtt), timeout_s=timeout_s)


def put(bench: DeliveryBench, **fields: Any) -> None:
    """Publish without the least interval, unless `fields` has another."""
    made = MqttPosesDestination(type="mqtt_poses", id="ha", deadband_m=fields.pop("deadband_m", 0.0))
    bench.put(made.model_copy(update={"interval_s": 0.0} | fields))


def enter(bench: DeliveryBench, *tags: str) -> None:
    dock = Zone(id="dock", name="Loading dock", shape=Circle(type="circle", x=0, y=0, radius_m=5))
    bench.zones.put("dock", dock)
    bench.store.commit([], {StateKey("zone", "dock", tag): StateValue(1, 1) for tag in tags})


@versions
def test_only_a_tracked_tag_has_a_position_and_who_subscribes_later_gets_it(tmp_path: Path, version: str) -> None:
    with mosquitto(tmp_path) as broker:
        bench = on(broker, version)
        put(bench)
        enter(bench, "a b")
        bench.live.move("a b", x=1.2345, y=2.0, z=0.5, heading=0.1, speed=1.5, sigma_pos=0.25)
        bench.live.move("lost", "ambiguous", x=7.0, y=8.0, state=State.AMBIGUOUS, reason=StateReason.SEVERAL_MODES)
        bench.live.move("lost", x=7.0, y=8.0, state=State.LOST, reason=StateReason.RANGES_MISSING)
        with bench.thread:
            with subscribed(broker) as heard:
                wait_until(
                    lambda: heard.tag("ambiguous") and heard.tag("lost") and heard.last("dropanchor/yard/zone/dock")
                )
            with subscribed(broker) as heard:
                wait_until(lambda: heard.tag("a%20b") and heard.tag("ambiguous") and heard.tag("lost"))
                wait_until(lambda: heard.last("dropanchor/yard/zone/dock") and heard.last(STATUS))
                tracked, lost, ambiguous = (heard.tag(tag) for tag in ("a%20b", "lost", "ambiguous"))
                assert heard.last(STATUS) == "online"
                assert heard.last("dropanchor/yard/zone/dock") == {
                    "zone": "dock",
                    "name": "Loading dock",
                    "count": 1,
                    "tags": ["a b"],
                }
                bench.live.answers.site.set_tag("a b", TagSettings(name="Cart 3"))
                site = bench.live.answers.site
                site.set_site(site.site.model_copy(update={"georeference": Georeference(lat=48.0, lon=11.0)}))
                wait_until(lambda: "latitude" in heard.tag("a%20b"))
                placed = heard.tag("a%20b")
                assert "latitude" not in heard.tag("ambiguous")
        with subscribed(broker) as heard:
            wait_until(lambda: heard.last(STATUS) == "offline")
    assert tracked == {
        "tag": "a b",
        "name": "a b",
        "t_ns": bench.live.now_ns,
        "t_utc": "2027-01-15T08:00:00.000000000Z",
        "state": "tracking",
        "reason": "resolved",
        "hint": tracked["hint"],
        "zones": ["dock"],
        "area": "Loading dock",
        "x": 1.234,
        "y": 2.0,
        "z": 0.5,
        "heading_rad": 0.1,
        "speed_mps": 1.5,
        "sigma_pos_m": 0.25,
    }
    assert placed == tracked | {
        "name": "Cart 3",
        "latitude": placed["latitude"],
        "longitude": placed["longitude"],
        "gps_accuracy": 0.49,
    }
    assert (placed["latitude"], placed["longitude"]) == pytest.approx((48.000018, 11.0000166), abs=1e-6)
    for said, state, reason in ((lost, "lost", "ranges_missing"), (ambiguous, "ambiguous", "several_modes")):
        assert (said["state"], said["reason"]) == (state, reason)
        assert said.keys() == {"tag", "name", "t_ns", "t_utc", "state", "reason", "hint", "zones", "area"}


@versions
def test_a_broker_that_was_away_gets_the_newest_pose_of_each_tag_once(tmp_path: Path, version: str) -> None:
    with mosquitto(tmp_path) as broker:
        bench = on(broker, version)
        put(bench)
        bench.live.move("a", "b", x=0.0)
        with bench.thread:
            with subscribed(broker) as heard:
                wait_until(lambda: heard.tag("a") and heard.tag("b"))
            broker.stop()
            for x in range(1, 100):
                bench.live.now_ns += 1000
                bench.live.move("a", x=float(x))
            wait_until(lambda: bench.thread.problem_of(0, "ha") is not None)
            assert bench.counts("ha") == (0, 0)
            broker.start()
            with subscribed(broker) as heard:
                wait_until(lambda: heard.tag("a") and heard.tag("b") and heard.last(STATUS) == "online")
                wait_until(lambda: bench.thread.problem_of(0, "ha") is None)
                bench.live.now_ns += 1000
                bench.live.move("a", x=100.0)
                wait_until(lambda: heard.tag("a")["x"] == 100.0)
                assert (heard.xs("a"), heard.xs("b")) == ([99.0, 100.0], [0.0])


def test_a_service_that_is_killed_is_offline_for_its_readers(tmp_path: Path) -> None:
    program = (
        "import sys, time\n"
        "from dropanchor_schemas.destinations import MqttPosesDestination\n"
        "from dropanchor_service.settings.events import MqttSettings\n"
        "from support.delivery import DeliveryBench\n"
        "bench = DeliveryBench(mqtt=MqttSettings(server='127.0.0.1', port=int(sys.argv[1]), tls=False))\n"
        "bench.put(MqttPosesDestination(type='mqtt_poses', id='ha'))\n"
        "with bench.thread:\n"
        "    time.sleep(600)\n"
    )
    with mosquitto(tmp_path) as broker, subscribed(broker) as heard:
        tests = Path(__file__).parents[2]
        environment = os.environ | {"PYTHONPATH": str(tests)}
        with subprocess.Popen([sys.executable, "-c", program, str(broker.port)], env=environment) as process:
            wait_until(lambda: heard.last(STATUS) == "online")
            process.send_signal(signal.SIGKILL)
            wait_until(lambda: heard.last(STATUS) == "offline")


def change(bench: DeliveryBench, heard: Heard, **fields: Any) -> None:
    """Change the destination, and wait until it has sent everything again."""
    before = len(heard.payloads["dropanchor/yard/tag/look"])
    put(bench, **fields)
    wait_until(lambda: len(heard.payloads["dropanchor/yard/tag/look"]) > before)


def test_a_tag_that_hardly_moves_or_moves_too_often_is_silent_but_its_state_is_not(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker, subscribed(broker) as heard:
        bench = on(broker)
        put(bench, interval_s=3600, deadband_m=1.0)
        bench.live.move("still", "hasty", "look", x=0.0)
        with bench.thread:
            wait_until(lambda: heard.tag("look"))
            change(bench, heard, deadband_m=1.0)
            for x, state in ((0.9, State.DEGRADED), (1.8, State.TRACKING)):
                bench.live.now_ns += 1000
                bench.live.move("still", x=x)
                bench.live.move("look", state=state)
                wait_until(lambda state=state: heard.tag("look")["state"] == state.name.lower())  # type: ignore[misc]
            wait_until(lambda: heard.tag("still")["x"] == 1.8)
            assert set(heard.xs("still")) == {0.0, 1.8}
            change(bench, heard, interval_s=3600)
            bench.live.now_ns += 1000
            bench.live.move("hasty", x=50.0)
            bench.live.move("look", state=State.DEGRADED)
            wait_until(lambda: heard.tag("look")["state"] == "degraded")
            bench.live.now_ns += 1000
            bench.live.move("hasty", x=60.0)
            bench.live.move("look", state=State.COASTING)
            wait_until(lambda: heard.tag("look")["state"] == "coasting")
            assert 60.0 not in heard.xs("hasty")
            bench.live.now_ns += 600 * 10**9  # nothing comes any longer
            wait_until(lambda: heard.tag("hasty")["state"] == "lost" and "x" not in heard.tag("hasty"))


def test_a_wrong_password_is_named_and_a_refused_topic_stops_no_other(tmp_path: Path) -> None:
    with secured_broker(tmp_path, "topic readwrite dropanchor/#\ntopic read #") as broker, subscribed(broker) as heard:
        bench = bench_of(broker, password="wrong")
        put(bench)
        bench.live.move("a", x=1.0)
        with bench.thread:
            wait_until(lambda: "refuses the connection: Not authorized" in (bench.thread.problem_of(0, "ha") or ""))
            (tmp_path / "password").write_text("yard")
            wait_until(lambda: heard.tag("a"))
            wait_until(lambda: bench.thread.problem_of(0, "ha") == "the broker answered: Not authorized")
            bench.live.now_ns += 1000
            bench.live.move("a", x=2.0)
            wait_until(lambda: heard.tag("a")["x"] == 2.0)


def test_a_broker_that_never_answers_delays_no_other_destination(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker, running_receiver(receiver := Receiver()):
        bench = on(broker, timeout_s=2.0)
        with subscribed(broker):
            assert broker.process is not None  # and it listens
        broker.process.send_signal(signal.SIGSTOP)
        put(bench)
        bench.hook(receiver)
        bench.live.move(*(f"tag-{number}" for number in range(1000)), x=1.0)
        with bench.thread:
            for _ in range(20):
                bench.happen("a", "b")
            wait_until(lambda: bench.counts() == (0, 0))
            wait_until(lambda: "did not answer" in (bench.thread.problem_of(0, "ha") or ""))
        broker.process.send_signal(signal.SIGCONT)


DISCOVERED = {  # component and object → the JSON of the topic that its templates read, and what Home Assistant shows
    "device_tracker/yard/tag-a_2Eb": ("tag/a.b", None),
    "sensor/yard/tag-a_2Eb": ("tag/a.b", "Loading dock"),
    "sensor/yard/zone-dock": ("zone/dock", "1"),
    "binary_sensor/yard/zone-dock": ("zone/dock", "ON"),
}
# https://www.home-assistant.io/integrations/device_tracker.mqtt/, …/sensor.mqtt/ and …/binary_sensor.mqtt/
COMMON = {"name", "unique_id", "availability", "availability_mode", "device", "origin", "json_attributes_topic"}
DOCUMENTED = {
    "device_tracker": COMMON | {"source_type", "json_attributes_template"},
    "sensor": COMMON | {"state_topic", "value_template", "unit_of_measurement", "state_class"},
    "binary_sensor": COMMON | {"state_topic", "value_template", "device_class"},
}


def rendered(template: str, payload: bytes) -> str:
    """Return what a template makes of a payload, with the filter that Home Assistant adds to those of Jinja."""
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined)
    environment.filters["to_json"] = lambda value: orjson.dumps(value).decode()
    return environment.from_string(template).render(value_json=orjson.loads(payload))


def discovered(tmp_path: Path) -> dict[str, bytes]:
    """Return what is on a broker for a tag in a zone, of which Home Assistant is told."""
    with mosquitto(tmp_path) as broker, subscribed(broker) as heard:
        bench = on(broker)
        put(bench)
        enter(bench, "a.b")
        bench.live.move("a.b", x=1.0)
        with bench.thread:
            wait_until(lambda: all(f"homeassistant/{name}/config" in heard.payloads for name in DISCOVERED))
            wait_until(lambda: heard.tag("a.b") and heard.last("dropanchor/yard/zone/dock"))
            wait_until(lambda: heard.last(STATUS) == "online")
            found = {topic: payloads[-1] for topic, payloads in heard.payloads.items()}
            bench.live.answers.forget(bench.live.answers.tags.register("a.b"))
            wait_until(lambda: heard.tag("a.b") == heard.last("homeassistant/sensor/yard/tag-a_2Eb/config") == 0)
            bench.destinations.remove("ha")
            wait_until(lambda: all(not heard.last(topic) for topic in found if topic != STATUS))
            wait_until(lambda: heard.last(STATUS) == "offline")
    return found


def test_home_assistant_finds_tags_and_zones_and_what_is_gone_leaves_the_broker(tmp_path: Path) -> None:
    found = discovered(tmp_path)
    for name, (topic, shown) in DISCOVERED.items():
        config = orjson.loads(found[f"homeassistant/{name}/config"])
        component = name.partition("/")[0]
        assert config.keys() <= DOCUMENTED[component]
        assert config["availability"][0] == {"topic": STATUS}
        payload = found[f"dropanchor/yard/{topic}"]
        for available in config["availability"]:
            assert available["topic"] in found
            assert rendered(available.get("value_template", "online"), payload) == "online"
        if shown is not None:
            assert rendered(config["value_template"], payload) == shown
        else:
            attributes = orjson.loads(rendered(config["json_attributes_template"], payload))
            assert attributes["in_zones"] == ["dock"]  # a site without a georeference
            lost = orjson.dumps({"state": "lost"})
            assert rendered(config["availability"][1]["value_template"], lost) == "offline"


HASS = shutil.which("hass")


@pytest.mark.skipif(HASS is None, reason="Home Assistant is not on the PATH: pip install homeassistant in its own venv")
def test_home_assistant_itself_accepts_what_it_is_told(tmp_path: Path) -> None:
    program = (
        "import asyncio, json, sys\n"
        "from homeassistant.components.mqtt import binary_sensor, device_tracker, sensor\n"
        "known = {'binary_sensor': binary_sensor, 'device_tracker': device_tracker, 'sensor': sensor}\n"
        "for topic, config in json.load(sys.stdin).items():\n"
        "    print(topic, sorted(known[topic.split('/')[1]].DISCOVERY_SCHEMA(config)))\n"
    )
    configs = {topic: orjson.loads(config) for topic, config in discovered(tmp_path).items() if "/config" in topic}
    python = Path(str(HASS)).with_name("python")
    run = subprocess.run([python, "-c", program], check=False, input=orjson.dumps(configs), capture_output=True)
    assert (run.returncode, run.stdout.count(b"\n")) == (0, len(DISCOVERED)), run.stderr.decode()
