"""`dropanchor-tag install` makes a systemd unit of a command."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dropanchor_tag_client.cli import main
from dropanchor_tag_client.sources.install import quoted, unit

SERIAL = ["serial", "/dev/serial/by-id/usb one", "--tag", "cart-1", "--spool", "spool", "--start", 'INITF "$X" 100%']


def value(text: str, key: str) -> str:
    found = re.search(rf"^{key}=(.*)$", text, re.MULTILINE)
    assert found, text
    return found[1]


def test_the_unit_runs_the_command_in_the_folder_of_the_installation(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["install", *SERIAL]) == 0
    said = capsys.readouterr()
    words = [word.replace("%%", "%").replace("$$", "$") for word in shlex.split(value(said.out, "ExecStart"))]
    assert words == [sys.executable, "-m", "dropanchor_tag_client", *SERIAL]
    assert value(said.out, "WorkingDirectory") == str(tmp_path)
    assert value(said.out, "Restart") == "always"
    assert value(said.out, "SupplementaryGroups") == "dialout"
    assert "systemctl enable --now dropanchor-tag-cart-1.service" in said.err


def test_the_unit_of_a_user_is_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["install", "--user", "--unit", "yard", "imu", "--device", "bno055", "--credentials", "cart"]) == 0
    text = (tmp_path / ".config/systemd/user/yard.service").read_text()
    assert value(text, "WantedBy") == "default.target"
    assert "User=" not in text
    assert "systemctl --user enable --now yard.service" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("plain-1.2/x", "plain-1.2/x"),
        ("two words", '"two words"'),
        ('a"b', '"a\\"b"'),
        ("100%", "100%%"),
        ("$HOME", '"$$HOME"'),
        ("back\\slash", '"back\\\\slash"'),
        ("", '""'),
    ],
)
def test_words_are_quoted_for_systemd(word: str, expected: str) -> None:
    assert quoted(word) == expected


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize("for_user", [False, True])
def test_systemd_accepts_the_unit(tmp_path: Path, for_user: bool) -> None:
    path = tmp_path / "tag.service"
    path.write_text(unit(SERIAL, for_user=for_user))
    command = ["systemd-analyze", *(["--user"] if for_user else []), "verify", str(path)]
    environment = os.environ | {"XDG_RUNTIME_DIR": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("words", [[], ["simulate"], ["publish", "--tag", "a"], ["dance"]])
def test_only_commands_that_run_for_ever_are_installed(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["install", *words]) == 2
    assert "no command was given" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["../../.profile", "a/b", "a b", "a\nb", "x" * 300])
def test_the_name_of_a_unit_is_no_path(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["install", "--user", "--unit", name, *SERIAL]) == 2
    assert "cannot name a unit" in capsys.readouterr().err
    assert list(tmp_path.rglob("*")) == []


def test_a_command_that_is_wrong_is_not_installed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["install", "serial", "/dev/ttyACM0", "--module", "nonsense"])
    assert end.value.code == 2
    assert "no module is called nonsense" in capsys.readouterr().err
