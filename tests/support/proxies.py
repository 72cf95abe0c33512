"""Run nginx and Caddy on loopback, with the configurations of the guide for proxies."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.certificate import self_signed
from support.patience import PATIENCE_S
from support.service import ROOT
from support.zenoh_router import free_port

GUIDE = (ROOT / "service/docs/how-to/put-it-behind-a-proxy.md").read_text()
SERVICE = "127.0.0.1:8080"


def program(name: str) -> str:
    """Return the path of a proxy. Skip the test without one."""
    found = shutil.which(name) or shutil.which(name, path="/usr/sbin")
    if found is None:
        pytest.skip(f"{name} is not installed: make proxies")
    return found


def of_guide(language: str) -> str:
    """Return the configuration in the guide."""
    (text,) = re.findall(rf"^```{language}\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)
    return str(text)


@contextmanager
def nginx(folder: Path, service: str) -> Iterator[tuple[str, Path]]:
    """Run nginx before the service at this address. Yield the address of the proxy and its certificate."""
    path, port = program("nginx"), free_port()
    certificate, key = self_signed(folder)
    changed = {
        "listen 443": f"listen 127.0.0.1:{port}",
        "/etc/ssl/yard.pem": str(certificate),
        "/etc/ssl/yard.key": str(key),
        SERVICE: service,
    }
    places = "".join(f"{name}_temp_path {folder}/{name};\n" for name in ("client_body", "proxy"))
    events = "daemon off; master_process off; error_log stderr;\nevents {}\n"
    text = f"pid {folder}/pid; {events}http {{\naccess_log off;\n{places}{_with(of_guide('nginx'), changed)}}}\n"
    (folder / "nginx.conf").write_text(text)
    with _running([path, "-p", str(folder), "-e", "stderr", "-c", str(folder / "nginx.conf")]):
        yield f"https://127.0.0.1:{port}", certificate


@contextmanager
def caddy(folder: Path, service: str) -> Iterator[tuple[str, Path]]:
    """Run Caddy, as `nginx` does."""
    path, port = program("caddy"), free_port()
    certificate, key = self_signed(folder)
    address = f"https://127.0.0.1:{port}"
    changed = {"yard.example.com {": f"{address} {{\n  tls {certificate} {key}", SERVICE: service}
    (folder / "Caddyfile").write_text("{\n  admin off\n  auto_https off\n}\n" + _with(of_guide("caddy"), changed))
    words = [path, "run", "--adapter", "caddyfile", "--config", str(folder / "Caddyfile")]
    with _running(["env", f"HOME={folder}", f"XDG_DATA_HOME={folder}", f"XDG_CONFIG_HOME={folder}", *words]):
        yield address, certificate


def _with(text: str, changed: dict[str, str]) -> str:
    for old, new in changed.items():
        assert old in text, old
        text = text.replace(old, new)
    return text


@contextmanager
def _running(command: list[str]) -> Iterator[None]:
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.terminate()
            process.wait(PATIENCE_S)
