"""Without credentials the service listens only on loopback, unless the settings allow more."""

import subprocess
from pathlib import Path
from typing import Any

import pytest

from dropanchor_service.security.credentials import credentials_of
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io.exposure import is_loopback, refuse_exposure
from support.patience import PATIENCE_S
from support.secured import secured_site
from support.service import command, environment
from support.zenoh_router import free_endpoint


def check(**settings: Any) -> None:
    model = Settings.model_validate(settings)
    refuse_exposure(model, credentials_of(model))


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "localhost"])
def test_the_loopback_needs_no_credentials(host: str) -> None:
    assert is_loopback(host)
    bracketed = f"[{host}]" if ":" in host else host
    check(http={"host": host}, zenoh={"listen": f"tcp/{bracketed}:7447"})


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "2001:db8::1"])
def test_other_addresses_are_refused_with_both_remedies(host: str) -> None:
    bracketed = f"[{host}]" if ":" in host else host
    for listener in ({"http": {"host": host}}, {"zenoh": {"listen": f"tcp/{bracketed}:7447"}}):
        with pytest.raises(SettingsError) as caught:
            check(**listener)
        assert "dropanchor security init" in str(caught.value)
        assert "--insecure" in str(caught.value)
        assert host in str(caught.value)
        check(**listener, insecure=True)


def test_all_exposed_listeners_are_named_at_once() -> None:
    with pytest.raises(SettingsError, match=r"HTTP at 0\.0\.0\.0 and Zenoh at tcp/0\.0\.0\.0:7447 would be"):
        check(http={"host": "0.0.0.0"}, zenoh={"listen": "tcp/0.0.0.0:7447, tcp/127.0.0.1:7448"})


def test_a_service_that_only_connects_needs_no_credentials() -> None:
    check(zenoh={"connect": "tcp/192.0.2.1:7447", "listen": "tcp/0.0.0.0:7447"})


def test_with_credentials_zenoh_may_listen_anywhere_with_tls(tmp_path: Path) -> None:
    folder = secured_site(tmp_path / "security").folder.path
    check(zenoh={"listen": "tls/0.0.0.0:7447"}, security={"folder": folder})
    with pytest.raises(SettingsError, match=r"Zenoh at tcp/0\.0\.0\.0:7447 would be open"):
        check(zenoh={"listen": "tcp/0.0.0.0:7447"}, security={"folder": folder})


def test_missing_credentials_are_named(tmp_path: Path) -> None:
    with pytest.raises(
        SettingsError, match=r"security\.folder: there are no credentials in .*: dropanchor security init"
    ):
        check(security={"folder": tmp_path})


@pytest.mark.parametrize(
    ("text", "refused"),
    [
        ('{mode: "router"}', True),
        ('{mode: "router", listen: {endpoints: ["tcp/0.0.0.0:7447"]}}', True),
        ('{mode: "router", listen: {endpoints: ["tls/0.0.0.0:7447"]}}', True),
        ('{mode: "router", listen: {endpoints: ["tcp/127.0.0.1:7447"]}}', False),
        ('{mode: "router", listen: {endpoints: {router: ["tcp/[::1]:7447"], peer: ["tcp/0.0.0.0:1"]}}}', False),
        ('{mode: "client", connect: {endpoints: ["tcp/192.0.2.1:7447"]}}', False),
        (
            '{mode: "router", listen: {endpoints: ["tls/[::]:7447"]}, transport: {link: {tls: {enable_mtls: true}}}}',
            False,
        ),
        (
            '{mode: "router", listen: {endpoints: ["tcp/[::]:7447"]}, transport: {link: {tls: {enable_mtls: true}}}}',
            True,
        ),
    ],
)
def test_a_zenoh_configuration_file_is_checked_too(tmp_path: Path, text: str, refused: bool) -> None:
    file = tmp_path / "router.json5"
    file.write_text(text)
    if refused:
        with pytest.raises(SettingsError, match=r"Zenoh at .* would be open to the network"):
            check(zenoh={"config_file": file})
    else:
        check(zenoh={"config_file": file})


@pytest.mark.parametrize(
    "arguments",
    [["serve", "--port", "0", "--host", "0.0.0.0"], ["router", "--zenoh-listen", "tcp/0.0.0.0:0"]],
    ids=["serve", "router"],
)
def test_the_program_exits_before_it_listens(arguments: list[str]) -> None:
    listen = [] if "--zenoh-listen" in arguments else ["--zenoh-listen", free_endpoint()]
    result = subprocess.run(
        command(*arguments, *listen), capture_output=True, text=True, env=environment(), timeout=PATIENCE_S, check=False
    )
    assert result.returncode == 2
    assert "without credentials" in result.stderr
    assert "Traceback" not in result.stderr
