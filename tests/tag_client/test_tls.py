"""TLS: the router admits a tag with the right certificate; other tags get an error that says what to check."""

import shutil
import subprocess
from pathlib import Path

import pytest

from dropanchor_tag_client import ConnectError, SessionSettings, TagClient
from support.listening import listening
from support.patience import PATIENCE_S
from support.zenoh_router import free_port, running_router, wait_until

needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates")


def openssl(folder: Path, *arguments: str) -> None:
    subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True)


def authority(folder: Path, name: str) -> None:
    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-noenc")
    openssl(folder, "req", "-x509", *key, "-keyout", f"{name}.key", "-out", f"{name}.pem", "-subj", f"/CN={name}")


def certificate(folder: Path, name: str, ca: str) -> None:
    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-noenc")
    openssl(folder, "req", *key, "-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj", f"/CN={name}")
    (folder / "names.ext").write_text("subjectAltName=DNS:localhost,IP:127.0.0.1\n")
    signed_by = ("-CA", f"{ca}.pem", "-CAkey", f"{ca}.key", "-CAcreateserial", "-extfile", "names.ext")
    openssl(folder, "x509", "-req", "-in", f"{name}.csr", *signed_by, "-out", f"{name}.pem", "-days", "2")


@needs_openssl
def test_only_a_tag_with_a_certificate_of_the_right_authority_can_connect(tmp_path: Path) -> None:
    for ca in ("ours", "theirs"):
        authority(tmp_path, ca)
    for name, ca in (("router", "ours"), ("tag", "ours"), ("foreign", "theirs")):
        certificate(tmp_path, name, ca)
    tls, plain = f"tls/localhost:{free_port()}", f"tcp/127.0.0.1:{free_port()}"
    files = {
        "root_ca_certificate": str(tmp_path / "ours.pem"),
        "listen_private_key": str(tmp_path / "router.key"),
        "listen_certificate": str(tmp_path / "router.pem"),
        "enable_mtls": True,
    }

    def client(name: str | None, ca: str = "ours") -> TagClient:
        cert, key = (None, None) if name is None else (tmp_path / f"{name}.pem", tmp_path / f"{name}.key")
        settings = SessionSettings(connect=tls, ca=tmp_path / f"{ca}.pem", cert=cert, key=key)
        return TagClient("a", connect=settings, connect_timeout_s=PATIENCE_S if name == "tag" and ca == "ours" else 0.7)

    with running_router([tls, plain], {"link": {"tls": files}}), listening(plain) as heard:
        with client("tag") as tag:
            tag.publish_range(1, 1.0)
            wait_until(lambda: heard.ranges() == [1.0])
        for refused in (client("foreign"), client(None), client("tag", ca="theirs")):
            with pytest.raises(ConnectError, match="the certificates"):
                refused.open()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"connect": "127.0.0.1:7447"}, "an endpoint such as tcp/"),
        ({"connect": "tcp/"}, "an endpoint such as tcp/"),
        ({"connect": "tls/h:1", "cert": "a"}, "cert and key go together"),
        ({"connect": "tls/h:1", "ca": "nowhere.pem"}, "ca: there is no file nowhere.pem"),
        ({"connect": "tcp/h:1", "ca": "nowhere.pem"}, "not a tls/ or quic/ endpoint"),
        ({"user": "a"}, "user and password go together"),
    ],
)
def test_settings_that_cannot_work_are_errors_before_any_connection(settings: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SessionSettings(**settings)  # type: ignore[arg-type]
