"""A site with the tags of `dropanchor demo`, which have driven for a while and go on."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread

from dropanchor_tag_client import TagClient
from dropanchor_tag_client.simulator.live import Delivery, deliveries, start_poses
from dropanchor_tag_client.simulator.sensors import preset
from support.service import Running, running_service
from support.zenoh_router import wait_until

TAGS = ("forklift", "picker", "truck", "patrol", "cart", "mower")
"""What the tags of the demo are, in their order. Each moves as the demo's with the default seed."""
_ANCHOR, _SEED = "1", 0
_ZONES = {
    "dock": ("Dock", "#2f6fde", [(14, 9), (26, 9), (26, 19), (14, 19)]),
    "storage": ("Storage", "#1f9d61", [(-24, 3), (-8, 3), (-8, 17), (-24, 17)]),
}
_SPEED = 30.0
"""How much faster than it happened the past is sent."""


@dataclass(frozen=True)
class Yard:
    """A service with driving tags. began_ns: time of their first samples."""

    service: Running
    began_ns: int


@contextmanager
def running_yard(folder: Path, past_s: float) -> Iterator[Yard]:
    """Run a service whose history holds `past_s` of the tags, and let them drive on until the block ends."""
    folder.mkdir()
    arguments = ("--config", str(_settings_file(folder)), "--data-dir", str(folder / "data"))
    with running_service(*arguments) as service:
        for zone, (name, colour, points) in _ZONES.items():
            shape = {"type": "polygon", "points": points}
            service.put(f"/api/v1/zones/{zone}", {"id": zone, "name": name, "colour": colour, "shape": shape})
        yard = Yard(service, time.time_ns() - round(past_s * 1e9))
        with _driving(yard):
            wait_until(lambda: _is_present(service), 60.0 + 4 * past_s / _SPEED)
            yield yard


def _settings_file(folder: Path) -> Path:
    """Write what an operator of the demo knows: the anchor, the start of each tag, and that its IMU points ahead."""
    lines = ['[site]\nname = "Yard"', f'[[site.anchors]]\nid = "{_ANCHOR}"']
    for tag, pose in zip(TAGS, start_poses(len(TAGS), _SEED), strict=True):
        start = f"{{ x = {pose.x}, y = {pose.y}, heading_rad = {pose.heading_rad} }}"
        lines += [f"[tags.{tag}]\nname = {json.dumps(tag.title())}\nmount_angle_rad = 0.0\nstart = {start}"]
    file = folder / "yard.toml"
    file.write_text("\n".join(lines) + "\n")
    return file


@contextmanager
def _driving(yard: Yard) -> Iterator[None]:
    stop = Event()
    with ExitStack() as stack:
        clients = [stack.enter_context(TagClient(tag, connect=yard.service.zenoh)) for tag in TAGS]
        thread = Thread(target=_drive, args=(clients, yard.began_ns, stop))
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()


def _drive(clients: list[TagClient], began_ns: int, stop: Event) -> None:
    """Publish until `stop`: the past as fast as _SPEED allows, and the present when it happens."""
    started_ns = time.time_ns()
    for delivery in deliveries(len(clients), "yard", _SEED, preset("calibrated"), began_ns):
        due_ns = max(began_ns + delivery.due_s * 1e9, started_ns + delivery.due_s * 1e9 / _SPEED)
        if stop.wait(max(0.0, (due_ns - time.time_ns()) / 1e9)):
            return
        _publish(clients[delivery.tag], delivery)


def _publish(client: TagClient, delivery: Delivery) -> None:
    for imu in delivery.imu:
        client.publish_imu(imu.acc, imu.gyro, imu.mag, t_ns=imu.t_ns)
    for sample in delivery.ranges:
        client.publish_range(_ANCHOR, sample.range_m, std_m=sample.std_m, t_ns=sample.t_ns)


def _is_present(service: Running) -> bool:
    poses = service.get("/api/v1/poses")["poses"]
    return len(poses) == len(TAGS) and all(pose["age_s"] < 1.0 for pose in poses)
