"""Tags that speak HTTP only, through a real service: a key, posted batches, a pose over REST."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.sync.client import connect

from dropanchor_schemas.answers import SamplesAcknowledged
from dropanchor_schemas.wire import ENCODING_JSON, Frame, encode_json
from dropanchor_service.cli import main
from support import phyphox
from support.patience import PATIENCE_S
from support.sensor_logger import G, message, recording
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import free_port, wait_until

SENSORS = {
    "gyroscope": lambda t_ns: (0.0, 0.0, 1e-4 * (t_ns // 10_000_000 % 7)),  # no sensor repeats itself to the last bit
    "accelerometer": lambda t_ns: (1e-3 * (t_ns // 10_000_000 % 5), 0.0, 0.0),
    "gravity": lambda _: (0.0, 0.0, -G),
    "magnetometer": lambda _: (0.0, 20.0, -40.0),
}
PHONE, SAMPLES = "/api/v1/ingest/sensor-logger", "/api/v1/ingest/samples"
PHYPHOX = "/api/v1/ingest/phyphox"
TAGS = ("anna", "phyphox", "no-numbers", "socket", "again", "gap")
"""One for each test that shares the service."""


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running_service("--config", str(settings_file(tmp_path_factory.mktemp("service"), TAGS))) as running:
        yield running


def ranges(seconds: int, start_ns: int) -> list[bytes]:
    """What the other side measured, a message per second."""
    walk = straight_north(10 * seconds, start_ns + seconds * 1_000_000_000)
    parts = [walk.ranges[first : first + 10] for first in range(0, len(walk.ranges), 10)]
    return [encode_json(Frame(ranges=part, sequence=n, boot_id=7)) for n, part in enumerate(parts)]


def test_a_phone_and_ranges_from_elsewhere_for_the_same_tag_become_a_pose(service: Running) -> None:
    seconds = 20
    start_ns = time.time_ns() - seconds * 1_000_000_000
    batches = list(recording(seconds, SENSORS, start_ns=start_ns))
    batches[3], batches[4] = batches[4], batches[3]
    for batch, distances in zip([*batches, batches[3]], [*ranges(seconds, start_ns), None], strict=True):
        assert service.ask("POST", f"{PHONE}?tag=anna", content=batch).status_code == 200
        if distances is not None:
            json = {"content-type": ENCODING_JSON}
            answer = service.ask("POST", f"{SAMPLES}?tag=anna", content=distances, headers=json)
            assert (answer.status_code, answer.json()) == (202, {"samples": 10})
    wait_until(lambda: samples(service, "anna") == {"imu": 100 * seconds - 1, "range": 10 * seconds})
    wait_until(lambda: service.get("/api/v1/tags/anna/pose")["t_ns"] > start_ns + (seconds - 1) * 1_000_000_000)
    pose = service.get("/api/v1/tags/anna/pose")
    status = service.get("/api/v1/tags/anna")
    wrong = 'dropanchor_rejected_total{reason="json_syntax"}'
    before = service.metric(wrong)
    service.ask("POST", f"{SAMPLES}?tag=anna", content=b"{", headers={"content-type": ENCODING_JSON})
    wait_until(lambda: service.metric(wrong) == before + 1)
    wait_until(lambda: service.get("/api/v1/tags/anna")["rejected"] == {"json_syntax": 1} | status["rejected"])
    assert set(status["rejected"]) == {"late"}  # the message that the next one overtook
    assert status["rejected"]["late"] < 300
    assert pose["anchor"] == "7"


def test_an_experiment_of_phyphox_and_ranges_from_elsewhere_become_a_pose(service: Running) -> None:
    seconds = 20
    start_ns = time.time_ns() - seconds * 1_000_000_000
    sensors: dict[str, phyphox.Value] = {
        "gyroscope": lambda _: (0.0, 0.0, 0.0),
        "accelerometer": lambda _: (0.0, 0.0, G),
        "magnetometer": lambda _: (0.0, 20.0, -40.0),
    }
    batches = list(phyphox.recording(seconds, sensors, start_ns * 1e-9, interval_s=1.0))
    for batch, distances in zip([*batches, batches[3]], [*ranges(seconds, start_ns), None], strict=True):
        assert service.ask("POST", f"{PHYPHOX}?tag=phyphox", content=batch).status_code == 200
        if distances is not None:
            json = {"content-type": ENCODING_JSON}
            service.ask("POST", f"{SAMPLES}?tag=phyphox", content=distances, headers=json)
    wait_until(lambda: samples(service, "phyphox") == {"imu": 100 * seconds - 1, "range": 10 * seconds})
    wait_until(lambda: service.get("/api/v1/tags/phyphox/pose")["t_ns"] > start_ns + (seconds - 1) * 1_000_000_000)
    assert service.ask("POST", f"{PHYPHOX}?tag=phyphox", content=b"{").status_code == 422
    wait_until(lambda: service.get("/api/v1/tags/phyphox")["rejected"].get("json_syntax") == 1)


def test_a_phone_over_http_is_online_and_its_empty_battery_is_told(tmp_path: Path) -> None:
    config = settings_file(tmp_path, ["anna"])
    with running_service("--config", str(config)) as service:
        assert not service.get("/api/v1/tags/anna")["online"]
        battery = {"name": "battery", "time": time.time_ns(), "values": {"batteryLevel": 0.12}}
        assert service.ask("POST", f"{PHONE}?tag=anna", content=message(0, [battery])).status_code == 200
        assert service.get("/api/v1/tags/anna")["online"]
        assert service.metric("dropanchor_tags_online") == 1
        wait_until(lambda: service.get("/api/v1/tags/anna")["health"] is not None)
        status = service.get("/api/v1/tags/anna")
        assert status["health"]["battery_fraction"] == 0.12
        assert [care["reason"] for care in status["needs_care"]] == ["battery_low"]


def test_a_phone_whose_gyroscope_gives_no_numbers_is_told_so_over_http(service: Running) -> None:
    sensors = SENSORS | {"gyroscope": lambda _: (float("nan"), 0.0, 0.0)}
    for batch in recording(2, sensors, start_ns=time.time_ns() - 2_000_000_000):
        answer = service.ask("POST", f"{PHONE}?tag=no-numbers", content=batch)
        assert (answer.status_code, answer.text.partition(":")[0]) == (
            499,
            "The readings of Gyroscope are not numbers",
        )


def test_a_phone_whose_clock_is_ahead_of_the_ranges_is_told(tmp_path: Path) -> None:
    config, ahead_ns = settings_file(tmp_path, ["anna"]), 800_000_000
    with running_service("--config", str(config)) as service:
        start_ns = time.time_ns() - 1_000_000_000
        for batch in recording(1, SENSORS, start_ns=start_ns + ahead_ns, batch_ns=200_000_000):
            service.ask("POST", f"{PHONE}?tag=anna", content=batch)
        [distances] = ranges(1, start_ns)
        service.ask("POST", f"{SAMPLES}?tag=anna", content=distances, headers={"content-type": ENCODING_JSON})
        wait_until(lambda: service.get("/api/v1/tags/anna")["clock_offset"] is not None)
        status = service.get("/api/v1/tags/anna")
        assert abs(status["clock_offset"]["offset_s"] - 0.8) < 0.3
        assert [care["reason"] for care in status["needs_care"]] == ["clock_offset"]
        assert service.metric('dropanchor_tags_needing_care{reason="clock_offset"}') == 1
        assert abs(service.metric("dropanchor_clock_offset_seconds_max") - 0.8) < 0.3


def test_an_open_web_socket_makes_its_tag_online(service: Running) -> None:
    url = f"{service.url.replace('http', 'ws')}/api/v1/ingest/stream?tag=socket"
    with connect(url, proxy=None) as socket:
        socket.recv(PATIENCE_S)
        assert service.get("/api/v1/tags/socket")["online"]
    wait_until(lambda: not service.get("/api/v1/tags/socket")["online"])


def test_a_message_that_is_sent_again_over_a_web_socket_counts_as_a_duplicate_and_is_used_once(
    service: Running,
) -> None:
    messages = ranges(3, time.time_ns() - 3_000_000_000)
    url = f"{service.url.replace('http', 'ws')}/api/v1/ingest/stream?tag=again"
    for sent in (messages[:2], messages[1:]):
        with connect(url, proxy=None) as socket:
            assert SamplesAcknowledged.model_validate_json(socket.recv(PATIENCE_S)).message == 0
            for message in sent:
                socket.send(message.decode())
                assert SamplesAcknowledged.model_validate_json(socket.recv(PATIENCE_S)).samples == 10
    wait_until(lambda: samples(service, "again") == {"range": 30})
    wait_until(lambda: service.get("/api/v1/tags/again")["rejected"] == {"duplicate": 1})


def samples(service: Running, name: str, headers: dict[str, str] | None = None) -> dict[str, int]:
    answer = service.ask("GET", "/api/v1/tags", headers=headers).json()
    return next((dict(tag["samples"]) for tag in answer["tags"] if tag["tag"] == name), {})


def test_the_last_batch_is_used_although_the_one_before_never_comes(service: Running) -> None:
    first, _, third = recording(3, SENSORS, start_ns=time.time_ns())
    service.ask("POST", f"{PHONE}?tag=gap", content=first)
    assert service.ask("POST", f"{PHONE}?tag=gap", content=third).json()["waiting"] == 1
    wait_until(lambda: samples(service, "gap").get("imu", 0) > 190)


def test_a_key_made_by_the_command_is_all_a_phone_needs_and_never_gets_into_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    security = tmp_path / "security"

    def run(*words: str) -> str:
        assert main([*words, "--security", str(security)]) == 0
        return capsys.readouterr().out.strip()

    port = free_port()
    run("security", "init", "--host", "localhost", "--listen", f"tls/127.0.0.1:{port}")
    token = run("key", "add", "anna-phone", "--tag", "anna").splitlines()[-1]
    assert "ingest of tag 'anna'" in run("key", "list")
    reader = {"authorization": f"Bearer {run('key', 'add', 'reader')}"}
    options = ("--security", str(security), "--zenoh-listen", f"tls/127.0.0.1:{port}", "--log-level", "DEBUG")
    with running_service(*options, ca=security / "ca.pem") as service:
        for batch in recording(2, SENSORS, start_ns=time.time_ns()):
            assert service.ask("POST", f"{PHONE}?token={token}", content=batch).status_code == 200
        assert service.ask("POST", f"{PHONE}?token={token}", content=b"nonsense").status_code == 499
        assert service.ask("POST", f"{PHONE}?token={token}x", content=b"{}").status_code == 401
        assert service.ask("POST", f"{PHONE}?token={token}&tag=bert", content=b"{}").status_code == 403
        wait_until(lambda: samples(service, "anna", reader).get("imu", 0) == 199)
        assert service.stop() == 0
    log = "".join(service.log)
    assert token not in log
    assert token.split("_", 2)[2] not in log
