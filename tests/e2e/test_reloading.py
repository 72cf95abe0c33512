"""SIGHUP takes changed settings over and never ends the service; a terminal that closes ends it as SIGTERM does."""

import os
import pty
import signal
import ssl
import subprocess
from pathlib import Path
from urllib.parse import urlsplit

from support.patience import PATIENCE_S
from support.secured import secured_site
from support.service import Running, command, environment, running_service
from support.zenoh_router import free_endpoint, wait_until

SETTINGS = """
[http]
requests_per_s = {rate}
[[site.anchors]]
id = "gate"
x = {x}
[tags.cart]
height_m = {height}
"""


def write(path: Path, x: float, height: float, rate: int = 50) -> None:
    path.write_text(SETTINGS.format(x=x, height=height, rate=rate))


def hang_up(service: Running, until: str) -> str:
    """Send SIGHUP, and return the line of the log with these words that follows."""
    seen = len(service.log)
    service.process.send_signal(signal.SIGHUP)
    wait_until(lambda: any(until in line for line in service.log[seen:]))
    return next(line for line in service.log[seen:] if until in line)


def anchor_x(service: Running, name: str = "gate") -> float:
    return float({anchor["id"]: anchor["x"] for anchor in service.get("/api/v1/anchors")["anchors"]}[name])


def test_a_hangup_takes_over_what_can_change_and_names_what_needs_a_restart(tmp_path: Path) -> None:
    config = tmp_path / "d.toml"
    write(config, x=1.0, height=1.0)
    with running_service("--config", str(config), "--data-dir", str(tmp_path / "data")) as service:
        assert "are as before" in hang_up(service, "reloaded")
        service.put("/api/v1/anchors/hall", {"id": "hall", "x": 9.0, "y": 0.0, "z": 0.0})
        write(config, x=5.0, height=2.0, rate=70)
        assert "http.requests_per_s" in hang_up(service, "only after a restart")
        assert (anchor_x(service), anchor_x(service, "hall")) == (5.0, 9.0)
        assert service.get("/api/v1/tags/cart/settings")["height_m"] == 2.0
        config.write_text("[http\n")
        assert "stay as they were" in hang_up(service, "cannot be used")
        assert anchor_x(service) == 5.0
        assert service.stop() == 0
    assert (tmp_path / "data" / "checkpoints").exists()


def test_a_service_whose_terminal_closes_ends_with_a_last_checkpoint(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    log = (tmp_path / "log").open("wb")
    arguments = ("serve", "--port", "0", "--zenoh-listen", free_endpoint(), "--data-dir", str(tmp_path / "data"))
    process = subprocess.Popen(
        command(*arguments),
        stdin=theirs,
        stdout=theirs,
        stderr=log,
        env=environment(),
        start_new_session=True,
        preexec_fn=lambda: _control(theirs),
    )
    os.close(theirs)
    try:
        wait_until(lambda: "ready at" in (tmp_path / "log").read_text(), 2 * PATIENCE_S)
        process.send_signal(signal.SIGHUP)  # by hand: the terminal is there
        wait_until(lambda: "reloaded" in (tmp_path / "log").read_text())
        os.close(ours)
        assert process.wait(PATIENCE_S) == 0
    finally:
        process.kill()
        process.wait()
        log.close()
    assert "stopped" in (tmp_path / "log").read_text()
    assert list((tmp_path / "data" / "checkpoints").iterdir())


def _control(terminal: int) -> None:
    import fcntl
    import termios

    fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whoever starts the tests with nohup ignores it


def test_a_hangup_takes_over_a_renewed_certificate(tmp_path: Path) -> None:
    folder = secured_site(tmp_path / "security").folder
    certificate, key = folder.certificate("service"), folder.key("service")
    config = tmp_path / "d.toml"
    config.write_text(f'[http]\ncertificate = "{certificate}"\nkey = "{key}"\n')
    with running_service("--config", str(config), ca=folder.certificate("ca")) as service:
        address = urlsplit(service.url)
        assert address.hostname is not None
        assert address.port is not None
        served = ssl.get_server_certificate((address.hostname, address.port))
        folder.renew([], days=20)
        assert str(certificate) in hang_up(service, "reloaded: the certificate")
        assert ssl.get_server_certificate((address.hostname, address.port)) not in ("", served)
        certificate.write_text("no certificate")
        assert "the former one stays" in hang_up(service, "cannot be used")
        assert service.get("/api/v1/poses")
        assert service.stop() == 0
