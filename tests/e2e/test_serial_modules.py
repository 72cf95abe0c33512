"""UWB modules on serial ports become dots that move: module, Zenoh, service, REST. Where a module has no IMU, another
program publishes one for the same tag."""

import struct
import time
from collections.abc import Callable
from contextlib import ExitStack
from math import hypot
from pathlib import Path
from random import gauss
from threading import Event, Thread

from dropanchor_tag_client import TagClient
from support.commands import start_python
from support.serial_module import Answer, plugged_in
from support.service import running_service, settings_file
from support.zenoh_router import wait_until

SPEED_MPS = 1.0


def shaken_acc() -> tuple[float, float, float]:
    """Return what an accelerometer measures on a moving vehicle, m/s². Without vibration it would seem to rest."""
    return gauss(0.0, 0.3), gauss(0.0, 0.3), gauss(9.81, 0.3)


def shaken_gyro() -> tuple[float, float, float]:
    """Return what its gyroscope measures, rad/s."""
    return gauss(0.0, 0.02), gauss(0.0, 0.02), gauss(0.0, 0.02)


def lec(range_m: float) -> bytes:
    return f"DIST,1,AN0,022E,0.00,0.00,0.00,{range_m:.2f}\r\n".encode()


def notification(range_m: float) -> bytes:
    head = "SESSION_INFO_NTF: {session_handle=1, sequence_number=3, block_index=3, n_measurements=1"
    return f'{head}\n\r [mac_address=0x0007, status="SUCCESS", distance[cm]={range_m * 100:.0f}]}}\r\n'.encode()


def trek(range_m: float) -> bytes:
    return f"mc 01 {round(range_m * 1000):08x} {0:08x} {0:08x} {0:08x} 095f c1 00024c24 a0:0\r\n".encode()


def makerfabs(range_m: float) -> bytes:
    ranges = f"range:({range_m * 100:.0f},0,0,0,0,0,0,0),ancid:(7,-1,-1,-1,-1,-1,-1,-1)"
    return f"AT+RANGE=tid:1,mask:01,seq:9,{ranges}\r\n".encode()


def linktrack(range_m: float) -> bytes:
    imu = (*shaken_gyro(), *shaken_acc())
    frame = bytearray(struct.pack("<BBHBB 34x 6f 38x", 0x55, 4, 133, 2, 1, *imu))
    frame += struct.pack("<I 12x B", time.monotonic_ns() // 1_000_000 % 2**32, 1)
    frame += struct.pack("<BB", 1, 7) + round(range_m * 1000).to_bytes(3, "little") + bytes(8)
    return bytes(frame) + bytes([sum(frame) & 0xFF])


MODULES: dict[str, tuple[int, Callable[[float], bytes], tuple[str, ...]]] = {
    "dwm1001": (115_200, lec, ("--name", "022E=7")),
    "dwm3001": (115_200, notification, ()),
    "trek1000": (115_200, trek, ("--name", "0=7")),
    "makerfabs": (115_200, makerfabs, ()),
    "linktrack": (921_600, linktrack, ()),
}


def publish_imu(endpoint: str, stop: Event) -> None:
    """What the IMUs of the modules without one measure on the way north, until it is told to stop."""
    with ExitStack() as stack:
        clients = [stack.enter_context(TagClient(tag, connect=endpoint)) for tag in MODULES if tag != "linktrack"]
        while not stop.wait(0.02):
            for client in clients:
                client.publish_imu(shaken_acc(), shaken_gyro(), (20.0, 0.0, -40.0))


def distance(began_s: float) -> float:
    return hypot(10.0, -20.0 + SPEED_MPS * (time.monotonic() - began_s))


def moving(text: Callable[[float], bytes], began_s: float) -> Answer:
    """A tag that goes north from (10, -20) past the anchor."""
    return lambda sent: b"" if sent else text(distance(began_s))


def is_on_its_range(x: float, y: float, began_s: float) -> bool:
    return abs(hypot(x, y) - distance(began_s)) < 0.5 and time.monotonic() - began_s > 8.0


def test_each_module_is_a_dot_that_moves_along_its_ranges(tmp_path: Path) -> None:
    config = settings_file(tmp_path, list(MODULES))
    with running_service("--config", str(config)) as service, ExitStack() as stack:
        began_s = time.monotonic()
        for name, (baud, text, options) in MODULES.items():
            module = stack.enter_context(plugged_in(tmp_path / name, moving(text, began_s), baud, period_s=0.1))
            arguments = ("--tag", name, "--module", name, "--connect", service.zenoh, *options)
            process = start_python("-m", "dropanchor_tag_client", "serial", str(module.path), *arguments)
            stack.callback(process.communicate, timeout=30)
            stack.callback(process.terminate)

        stop = Event()
        imu = Thread(target=publish_imu, args=(service.zenoh, stop))
        imu.start()
        stack.callback(imu.join)
        stack.callback(stop.set)

        def poses() -> dict[str, tuple[float, float]]:
            return {
                pose["tag"]: (pose["x"], pose["y"])
                for pose in service.get("/api/v1/poses")["poses"]
                if pose["x"] is not None
            }

        wait_until(lambda: set(poses()) == set(MODULES))
        first = poses()
        wait_until(lambda: all(is_on_its_range(*place, began_s) for place in poses().values()))
        assert all(hypot(x - first[tag][0], y - first[tag][1]) > 1.0 for tag, (x, y) in poses().items())
