"""Run Debian's MQTT broker mosquitto on loopback, and publish to it."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from support.zenoh_router import free_port, wait_until

PROGRAM = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
needs_mosquitto = pytest.mark.skipif(PROGRAM is None, reason="mosquitto is not installed: apt-get install mosquitto")


@dataclass
class Mosquitto:
    """A broker. options: lines of its configuration for the listener."""

    folder: Path
    port: int
    options: tuple[str, ...] = ("allow_anonymous true",)
    process: "subprocess.Popen[bytes] | None" = None

    def start(self) -> None:
        assert PROGRAM is not None
        lines = [f"listener {self.port} 127.0.0.1", *self.options, "persistence false", "user root", "log_dest stderr"]
        configuration = self.folder / "mosquitto.conf"
        configuration.write_text("\n".join(lines) + "\n")
        self.process = subprocess.Popen([PROGRAM, "-c", str(configuration)], stderr=subprocess.DEVNULL)

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None

    @contextmanager
    def publisher(self, ca: Path | None = None, user: str | None = None) -> Iterator[Client]:
        """Connect a client that publishes. user: also the password."""
        client = Client(CallbackAPIVersion.VERSION2)
        if ca is not None:
            client.tls_set(str(ca))
        if user is not None:
            client.username_pw_set(user, user)
        wait_until(lambda: _connects(client, self.port))
        client.loop_start()
        wait_until(client.is_connected)
        try:
            yield client
        finally:
            client.disconnect()
            client.loop_stop()


def _connects(client: Client, port: int) -> bool:
    try:
        client.connect("127.0.0.1", port)
    except ConnectionRefusedError:
        return False
    return True


@contextmanager
def mosquitto(folder: Path, *options: str) -> Iterator[Mosquitto]:
    broker = Mosquitto(folder, free_port(), options or ("allow_anonymous true",))
    broker.start()
    try:
        yield broker
    finally:
        broker.stop()
