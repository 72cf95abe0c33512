"""Events reach a real MQTT broker over TLS: acknowledged, in order per tag, and through its restart."""

import gc
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest
from paho.mqtt.client import Client

from dropanchor_schemas.destinations import MqttDestination
from dropanchor_service.delivery import queue
from dropanchor_service.delivery.queue import Patience
from dropanchor_service.delivery.thread import DeliveryThread
from dropanchor_service.settings.events import MqttSettings
from service.delivery.names import resolve_to_loopback
from support.certificate import self_signed
from support.delivery import LOOPBACK, DeliveryBench, in_order
from support.mosquitto import PROGRAM, Mosquitto, mosquitto, needs_mosquitto
from support.patience import PATIENCE_S
from support.zenoh_router import wait_until

pytestmark = needs_mosquitto


@pytest.fixture(autouse=True)
def _fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queue, "FIRST_RETRY_S", 0.05)


@pytest.fixture
def sockets_of_paho() -> Iterator[None]:
    """Close the sockets that paho leaves to the garbage collector, before another test gets their warnings."""
    yield
    gc.collect()


@contextmanager
def secured_broker(folder: Path, rights: str = "topic readwrite #") -> Iterator[Mosquitto]:
    """Run a broker with TLS, the user `yard` with the password `yard`, and these rights."""
    assert PROGRAM is not None
    certificate, key = self_signed(folder)
    users, access = folder / "users", folder / "rights"
    made = subprocess.run(
        ["mosquitto_passwd", "-b", "-c", str(users), "yard", "yard"], check=False, capture_output=True
    )
    assert made.returncode == 0, made.stderr
    access.write_text(f"user yard\n{rights}\n")
    options = (f"certfile {certificate}", f"keyfile {key}", f"password_file {users}", f"acl_file {access}")
    with mosquitto(folder, *options) as broker:
        yield broker


def bench_of(broker: Mosquitto, password: str = "yard", server: str = "127.0.0.1", **delivery: Any) -> DeliveryBench:
    file = broker.folder / "password"
    file.write_text(f"{password}\n")
    settings = MqttSettings(server=server, port=broker.port, user="yard", password_file=file)
    return DeliveryBench(mqtt=settings, authorities=broker.folder / "broker.pem", **delivery)


@contextmanager
def listening(broker: Mosquitto) -> Iterator[list[tuple[str, dict[str, Any]]]]:
    """Collect the topics and events that come until the block ends."""
    got: list[tuple[str, dict[str, Any]]] = []
    ready: list[int] = []

    def begin(client: Client) -> None:
        client.on_message = lambda _client, _data, message: got.append((message.topic, orjson.loads(message.payload)))
        client.on_subscribe = lambda _client, _data, number, _reasons, _properties: ready.append(number)
        client.subscribe("#", 1)

    with broker.publisher(broker.folder / "broker.pem", "yard") as client:
        begin(client)
        wait_until(lambda: bool(ready))
        yield got


def put(bench: DeliveryBench, **fields: Any) -> None:
    bench.put(MqttDestination(type="mqtt", id="mes", **fields))


def test_every_event_is_published_once_in_order_to_the_topic_of_its_tag(tmp_path: Path) -> None:
    with secured_broker(tmp_path) as broker, listening(broker) as got:
        bench = bench_of(broker)
        put(bench, topic="plant/{site}/{tag}/{type}")
        with bench.thread:
            for _ in range(20):
                bench.happen("a", "b+/#c")
            wait_until(lambda: bench.counts() == (0, 0))
            wait_until(lambda: len(got) == 40)
    assert {topic for topic, _ in got} == {
        "plant/yard/a/dropanchor.zone.enter",
        "plant/yard/b%2B%2F%23c/dropanchor.zone.enter",
    }
    events = [event for _, event in got]
    assert len({event["id"] for event in events}) == 40
    assert in_order(events)


def test_a_broker_that_restarts_gets_everything(tmp_path: Path) -> None:
    with secured_broker(tmp_path) as broker:
        bench = bench_of(broker)
        put(bench)
        with bench.thread:
            bench.happen("a")
            wait_until(lambda: bench.counts() == (0, 0))
            broker.stop()
            for _ in range(5):
                bench.happen("a", "b")
            wait_until(lambda: bench.thread.problem_of(0, "mes") is not None)
            assert bench.counts() == (10, 0)
            broker.start()
            wait_until(lambda: bench.counts() == (0, 0) and bench.thread.problem_of(0, "mes") is None)


def test_a_broker_without_the_right_to_publish_makes_dead_letters(tmp_path: Path) -> None:
    with secured_broker(tmp_path, "topic read #") as broker:
        bench = bench_of(broker)
        put(bench)
        with bench.thread:
            bench.happen("a")
            wait_until(lambda: bench.counts() == (0, 1))
    assert bench.deliveries.dead("mes")[0][1] == "the broker answered: Not authorized"


def test_a_wrong_password_is_said_and_mended_without_a_restart(tmp_path: Path) -> None:
    with secured_broker(tmp_path) as broker:
        bench = bench_of(broker, password="wrong")
        put(bench)
        with bench.thread:
            bench.happen("a")
            wait_until(lambda: "refuses the connection" in (bench.thread.problem_of(0, "mes") or ""))
            (tmp_path / "password").write_text("yard")
            wait_until(lambda: bench.counts() == (0, 0))


@pytest.mark.usefixtures("sockets_of_paho")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_broker_whose_certificate_is_not_trusted_gets_nothing(tmp_path: Path) -> None:
    with secured_broker(tmp_path) as broker:
        settings = MqttSettings(server="127.0.0.1", port=broker.port)
        bench = DeliveryBench(mqtt=settings)
        put(bench)
        with bench.thread:
            bench.happen("a")
            wait_until(lambda: "certificate" in (bench.thread.problem_of(0, "mes") or "").lower())
            assert bench.counts() == (1, 0)


@pytest.mark.usefixtures("sockets_of_paho")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_destinations_of_all_sites_share_one_connection_and_one_thread(tmp_path: Path) -> None:
    with secured_broker(tmp_path) as broker, listening(broker) as got:
        benches = [bench_of(broker) for _ in range(5)]
        shared, outboxes = benches[0].channels, []
        for bench in benches:
            put(bench)
            outboxes.append(replace(bench.outbox, channels=shared))
        before = threading.active_count()
        with DeliveryThread(outboxes, Patience(0.2, 10**15), time.time_ns):
            for bench in benches:
                bench.happen("a", "b")
            wait_until(lambda: len(got) == 10 and all(bench.counts() == (0, 0) for bench in benches))
            connections = sum("paho" in thread.name for thread in threading.enumerate())
            assert connections == 2, [thread.name for thread in threading.enumerate()]  # one listens for the test
            broker.stop()
            for bench in benches:
                bench.happen("c")
            wait_until(lambda: all(bench.counts() == (1, 0) for bench in benches))
            broker.start()
            wait_until(lambda: all(bench.counts() == (0, 0) for bench in benches))
        wait_until(lambda: threading.active_count() <= before)


@pytest.mark.usefixtures("sockets_of_paho")
def test_a_broker_whose_name_stands_for_an_address_inside_gets_nothing_unless_the_settings_allow_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    resolve_to_loopback(monkeypatch, "broker.example.com")
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        mqtt = MqttSettings(server="broker.example.com", port=port, tls=False)
        bench = DeliveryBench(mqtt=mqtt, allow_networks=())
        put(bench, topic="t")
        with bench.thread:
            bench.happen("a")
            wait_until(
                lambda: "127.0.0.1, which is the machine of the service" in (bench.thread.problem_of(0, "mes") or "")
            )
        connection, _ = listener.accept()
        with connection:
            connection.settimeout(PATIENCE_S)
            assert connection.recv(100) == b""
    with mosquitto(tmp_path) as broker:
        for server, networks in (("localhost", ()), ("broker.example.com", LOOPBACK)):
            settings = MqttSettings(server=server, port=broker.port, tls=False)
            bench = DeliveryBench(mqtt=settings, allow_networks=networks)
            put(bench, topic="t")
            with bench.thread:
                bench.happen("a")
                wait_until(lambda bench=bench: bench.counts() == (0, 0))  # type: ignore[misc]
