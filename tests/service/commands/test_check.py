"""`dropanchor check` names each fault that would end a start, and changes nothing."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from dropanchor_service.cli import main
from dropanchor_tag_client.folder_lock import FolderLock
from support.secured import secured_site
from support.zenoh_router import free_endpoint, free_port

SAID = "dropanchor check: "
WHAT_TO_DO = "stop that one or choose another port"
GOOD = "settings, credentials, folders and ports are good\n"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def taken() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def faults(capsys: pytest.CaptureFixture[str], *options: str) -> list[str]:
    """Return what the command finds with these options, and with free ports."""
    ports = [] if "--port" in options else ["--port", str(free_port())]
    zenoh = [] if any("zenoh" in option for option in options) else ["--zenoh-listen", free_endpoint()]
    code = main(["check", *ports, *zenoh, *options])
    out, err = capsys.readouterr()
    found = [line.removeprefix(SAID) for line in err.splitlines() if line.startswith(SAID)]
    assert (code, out) == ((1, "") if found else (0, GOOD))
    return found


def test_what_is_good_is_good_and_nothing_is_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    secured_site(tmp_path / "security")
    before = sorted(tmp_path.rglob("*"))
    assert faults(capsys, "--data-dir", "data", "--security", "security") == []
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ('unknown_tag = "refuse"', "unknown_tag is not a setting; did you mean unknown_tags?"),
        ('[basemap]\ntiles = "away.pmtiles"', "basemap.tiles: away.pmtiles cannot be read"),
        ('[security]\nfolder = "away"', "security.folder: there are no credentials in away"),
        (
            '[http]\ncertificate = "settings.toml"\nkey = "settings.toml"',
            "settings.toml with settings.toml cannot be used",
        ),
        ('[http]\nhost = "0.0.0.0"', "HTTP at 0.0.0.0 would be open to the network without credentials"),
        ('data_dir = "settings.toml/data"', "settings.toml is no folder"),
        ('[site]\nid = "a"\n[sites.b]\n', ""),
    ],
)
def test_each_fault_of_the_settings_is_named(settings: str, named: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("settings.toml").write_text(settings)
    (fault,) = faults(capsys, "--config", "settings.toml")
    assert named in fault


def test_ports_that_others_use_and_a_router_that_is_away_are_named(
    taken: int, capsys: pytest.CaptureFixture[str]
) -> None:
    found = faults(capsys, "--port", str(taken), "--zenoh-listen", f"tcp/127.0.0.1:{taken}")
    assert found == [f"cannot listen on 127.0.0.1 port {taken}: another program uses it; {WHAT_TO_DO}"]
    assert faults(capsys, "--port", str(taken), "--running", "--zenoh-connect", f"tcp/127.0.0.1:{taken}") == []
    assert "no router answers" in faults(capsys, "--zenoh-connect", free_endpoint())[0]


def test_a_data_folder_of_another_process_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with FolderLock(tmp_path):
        (fault,) = faults(capsys, "--data-dir", str(tmp_path))
        assert faults(capsys, "--data-dir", str(tmp_path), "--running") == []
    assert f"data_dir: {tmp_path} is in use by process" in fault
    assert faults(capsys, "--data-dir", str(tmp_path)) == []
