"""Run Debian's MQTT broker mosquitto on loopback, and publish to it."""

import datetime
import ipaddress
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
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


def self_signed(folder: Path) -> tuple[Path, Path]:
    """Write a certificate for 127.0.0.1 that signs itself, and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "127.0.0.1")])
    now = datetime.datetime.now(datetime.UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), True)
        .sign(key, hashes.SHA256())
    )
    cert_path, key_path = folder / "broker.pem", folder / "broker.key"
    cert_path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    key_path.write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    return cert_path, key_path
