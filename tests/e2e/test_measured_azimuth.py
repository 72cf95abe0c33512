"""Azimuths of an anchor come from a serial port, over MQTT and over HTTP, and place tags of which nothing is told."""

import json
import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np

from dropanchor_tag_client import TagClient
from dropanchor_tag_client.simulator.azimuth import AzimuthModel
from dropanchor_tag_client.simulator.live import deliveries, simulation
from dropanchor_tag_client.simulator.ranging import AnchorPlace
from dropanchor_tag_client.simulator.sensors import preset
from support.commands import start_python
from support.mosquitto import mosquitto, needs_mosquitto
from support.mqtt_bridge import bridge, publish, wait_for_line
from support.patience import PATIENCE_S
from support.serial_module import plugged_in
from support.service import Running, running_service
from support.zenoh_router import wait_until

FACING = 0.7
TAGS = ("pty-1", "mqtt", "http")
SITE = f'[[site.anchors]]\nid = "7"\nfacing_rad = {FACING}\nmirrors_behind = false\n'
RULES = """
[[rule]]
topic = "aoa/+"
tag = "{1}"
kind = "range"
fields = { anchor = "=7", range_m = "m" }

[[rule]]
topic = "aoa/+"
tag = "{1}"
kind = "bearing"
fields = { anchor = "=7", bearing_rad = "to_the_right", std_rad = "error" }
scale = { bearing_rad = -0.017453292519943295, std_rad = 0.017453292519943295 }
"""


Send = Callable[[float, float], object]
"""Takes a range, m, and an azimuth, degrees to the left of where the anchor faces."""


class Drive:
    """A simulated tag in the yard, whose ranges and azimuths are sent in each of several ways as they are measured."""

    def __init__(self, seed: int) -> None:
        azimuth = AzimuthModel(math.radians(5.0), facing=FACING)
        models = replace(preset("calibrated", range_hz=10.0, imu_hz=50.0), azimuth=azimuth, anchors=(AnchorPlace("7"),))
        self.t0_ns, self._began_s = time.time_ns(), time.monotonic()
        self._deliveries = deliveries(1, "yard", seed, models, self.t0_ns)
        self._truth = simulation("yard", seed, 0, models, 200.0).truth

    def place(self, t_ns: int) -> tuple[float, float]:
        t_s = (t_ns - self.t0_ns) * 1e-9
        x, y = (float(np.interp(t_s, self._truth.t_s, column)) for column in (self._truth.x, self._truth.y))
        return x, y

    @contextmanager
    def sent(self, clients: Sequence[TagClient], ways: Sequence[Send]) -> Iterator[None]:
        """Send until the block ends. clients: take the samples of the IMU."""
        ended = Event()

        def run() -> None:
            for part in self._deliveries:
                if ended.wait(max(0.0, self._began_s + part.due_s - time.monotonic())):
                    return
                for client in clients:
                    for t_ns, acc, gyro, mag in part.imu:
                        client.publish_imu(acc, gyro, mag, t_ns=t_ns)
                    client.flush()
                for one, azimuth in zip(part.ranges, part.bearings, strict=True):
                    for send in ways:
                        send(one.range_m, math.degrees(azimuth.bearing_rad))

        with ThreadPoolExecutor() as pool:
            running = pool.submit(run)
            try:
                yield
            finally:
                ended.set()
        running.result()


@contextmanager
def serial_port(service: Running, folder: Path) -> Iterator[Send]:
    lines = deque[bytes]()

    def measured(range_m: float, azimuth: float) -> None:
        found = {"Addr": "0x0001", "Status": "Ok", "D_cm": round(100 * range_m), "LAoA_deg": azimuth, "LFoM": 100}
        lines.append(json.dumps({"Block": 1, "results": [found]}).encode() + b"\r\n")

    def answer(_: bytes) -> bytes:
        return lines.popleft() if lines else b""

    options = ("--module", "qm33-json", "--tag-from-id", "--as-anchor", "7", "--tag", "pty-", "--azimuth-std", "5")
    with plugged_in(folder / "port", answer, period_s=0.02) as module:
        program = ("-m", "dropanchor_tag_client", "serial", str(module.path), "--connect", service.zenoh)
        process = start_python(*program, *options)
        try:
            yield measured
        finally:
            process.terminate()
            process.communicate(timeout=PATIENCE_S)


@contextmanager
def over_mqtt(service: Running, folder: Path) -> Iterator[Send]:
    (folder / "rules.toml").write_text(RULES)
    with (
        mosquitto(folder) as broker,
        bridge(service.zenoh, f"127.0.0.1:{broker.port}", "--template", str(folder / "rules.toml")) as process,
        broker.publisher() as client,
    ):
        wait_for_line(process, "connected")
        yield lambda range_m, azimuth: publish(
            client, "aoa/mqtt", {"m": range_m, "to_the_right": -azimuth, "error": 5.0}
        )


def over_http(service: Running) -> Send:
    def send(range_m: float, azimuth: float) -> None:
        seen = {"t_ns": time.time_ns(), "anchor": 7}
        bearing = seen | {"bearing_rad": math.radians(azimuth), "std_rad": math.radians(5.0)}
        body = {"range": [seen | {"range_m": range_m}], "bearing": [bearing]}
        assert service.ask("POST", "/api/v1/ingest/samples?tag=http", json=body).status_code == 202

    return send


@needs_mosquitto
def test_a_tag_is_tracked_at_once_whichever_way_its_azimuths_come(tmp_path: Path) -> None:
    (tmp_path / "yard.toml").write_text(SITE)
    with running_service("--config", str(tmp_path / "yard.toml")) as service:
        first = dict[str, dict[str, Any]]()

        def all_tracked() -> bool:
            for pose in service.get("/api/v1/poses")["poses"]:
                if pose["state"] == "tracking":
                    first.setdefault(pose["tag"], pose)
            return set(first) == {*TAGS}

        with ExitStack() as stack:
            ways = [
                stack.enter_context(serial_port(service, tmp_path)),
                stack.enter_context(over_mqtt(service, tmp_path)),
                over_http(service),
            ]
            clients = [stack.enter_context(TagClient(tag, connect=service.zenoh)) for tag in TAGS]
            drive = Drive(48_800)
            stack.enter_context(drive.sent(clients, ways))
            wait_until(all_tracked)
        for pose in first.values():
            x, y = drive.place(int(pose["t_ns"]))
            assert math.hypot(pose["x"] - x, pose["y"] - y) < 0.1 * math.hypot(x, y)
