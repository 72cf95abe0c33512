"""`dropanchor router` listens where its file says, and says which file that is."""

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from dropanchor_service.cli import main
from dropanchor_service.security.folder import SecurityFolder
from support.commands import environment
from support.patience import PATIENCE_S
from support.secured import secured_site
from support.service import command
from support.zenoh_router import free_port, wait_until


@contextmanager
def router(folder: Path, log: Path, *options: str) -> Iterator[subprocess.Popen[bytes]]:
    with log.open("wb") as output:
        words = command("router", "--security", str(folder), *options)
        process = subprocess.Popen(words, env=environment(), stderr=output, stdout=output)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(PATIENCE_S)


def changed(file: Path, **sections: Any) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | sections))


def test_an_edited_endpoint_is_listened_at_and_survives_a_new_tag(tmp_path: Path) -> None:
    folder, log = secured_site(tmp_path / "security", "a").folder, tmp_path / "log"
    endpoint = f"tls/127.0.0.1:{free_port()}"
    changed(folder.router_file, listen={"endpoints": [endpoint]})
    assert main(["tag", "add", "b", "--security", str(folder.path)]) == 0
    assert SecurityFolder.open(folder.path).listen == (endpoint,)
    port = json.loads((folder.path / "tags" / "b" / "tag.json").read_text())["connect"].rpartition(":")[2]
    assert endpoint.endswith(port)
    with router(folder.path, log):
        wait_until(lambda: "ready at" in log.read_text())
    assert f"ready at {endpoint} (as in {folder.router_file}); access control as in" in log.read_text()
    assert "has other sections" not in log.read_text()


def test_other_changes_of_the_file_and_an_endpoint_that_is_given_are_named(tmp_path: Path) -> None:
    folder, log = secured_site(tmp_path / "security", "a").folder, tmp_path / "log"
    changed(folder.router_file, access_control={"enabled": False}, plugins={})
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with router(folder.path, log, "--zenoh-listen", endpoint):
        wait_until(lambda: "has other sections" in log.read_text())
    assert f"ready at {endpoint} (as given, not as in {folder.router_file})" in log.read_text()
    assert "uses: access_control, plugins." in log.read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{ // a comment\n}", "must be JSON, without comments"),
        ('{"listen": {"endpoints": [7]}}', "must be a list of texts"),
        ("[]", "must hold an object"),
    ],
)
def test_a_file_that_cannot_be_read_is_named_and_never_overwritten(
    tmp_path: Path, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = secured_site(tmp_path / "security", "a").folder
    folder.router_file.write_text(text)
    for arguments in (["router"], ["tag", "add", "b"], ["tag", "revoke", "a"]):
        assert main([*arguments, "--security", str(folder.path)]) == 2
        error = capsys.readouterr().err
        assert str(folder.router_file) in error
        assert words in error
    assert folder.router_file.read_text() == text
    assert not folder.bundle("b").exists()


def test_endpoints_by_mode_are_those_of_a_router_and_without_the_file_those_of_the_table(tmp_path: Path) -> None:
    folder = secured_site(tmp_path / "security", "a").folder
    changed(folder.router_file, listen={"endpoints": {"router": ["tls/[::1]:7"], "peer": ["tls/[::1]:8"]}})
    assert folder.listen == ("tls/[::1]:7",)
    folder.router_file.unlink()
    assert folder.listen == folder.table.listen
