"""The units are valid and start programs with options that exist."""

import os
import shlex
import shutil
import subprocess
from configparser import ConfigParser
from itertools import pairwise
from pathlib import Path

import pytest

from support.commands import python
from support.patience import PATIENCE_S
from support.service import ROOT, command, environment

FOLDER = ROOT / "deploy" / "systemd"
UNITS = sorted(FOLDER.glob("*.service"))
INSTALLED = "/opt/dropanchor/bin/dropanchor"


def unit(path: Path) -> ConfigParser:
    parser = ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(path.read_text())
    return parser


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_systemd_accepts_the_units(tmp_path: Path) -> None:
    program = tmp_path / "dropanchor"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    written = [*UNITS, *FOLDER.glob("*.timer")]
    for path in written:
        (tmp_path / path.name).write_text(path.read_text().replace(INSTALLED, str(program)))
    verified = subprocess.run(
        ["systemd-analyze", "verify", *(str(tmp_path / path.name) for path in written)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"SYSTEMD_LOG_LEVEL": "warning"},
    )
    ours = [line for line in verified.stderr.splitlines() if str(tmp_path) in line or "dropanchor" in line]
    assert not ours
    assert len(written) == 4


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_the_program_has_every_option_that_a_unit_passes(path: Path) -> None:
    program, command, *options = shlex.split(unit(path)["Service"]["ExecStart"])
    assert program == INSTALLED
    text = python("-m", "dropanchor_service", command, "--help").stdout
    assert text
    assert not [option for option in options if option.startswith("--") and option not in text]


def test_the_service_gets_time_to_stop_and_is_always_restarted() -> None:
    service = unit(ROOT / "deploy" / "systemd" / "dropanchor.service")["Service"]
    assert int(service["TimeoutStopSec"]) > 3
    assert service["Restart"] == "always"
    assert service["Type"] == "notify"
    assert "MemoryDenyWriteExecute" not in service


def test_the_backup_has_the_folders_that_the_service_is_given(tmp_path: Path) -> None:
    """The service has them as options, which its settings file does not know."""
    service, backup = (unit(FOLDER / f"{name}.service")["Service"] for name in ("dropanchor", "dropanchor-backup"))
    words = shlex.split(service["ExecStart"])
    given = {option: value for option, value in pairwise(words) if option.startswith("--")}
    for place in (given["--data-dir"], given["--security"]):
        (tmp_path / place[1:]).mkdir(parents=True)
        (tmp_path / place[1:] / "site.json").write_text("{}")
    (tmp_path / given["--config"][1:]).touch()

    def inside(text: str) -> str:
        places = text.replace("${STATE_DIRECTORY}", "/var/backups")
        return places.replace("/etc", f"{tmp_path}/etc").replace("/var", f"{tmp_path}/var")

    _, *options = shlex.split(inside(backup["ExecStart"]))
    variables = dict(word.split("=", 1) for word in inside(backup["Environment"]).split())
    subprocess.run(command(*options), env=environment(**variables), check=True, timeout=PATIENCE_S)
    (made,) = (tmp_path / "var" / "backups").iterdir()
    assert {path.name for path in made.iterdir()} == {"data", "security", "settings.toml", "SHA256SUMS"}
    assert (made / "data" / "site.json").exists()
    assert backup["ReadWritePaths"] == given["--data-dir"]


@pytest.mark.parametrize("name", ["dropanchor", "dropanchor-router"])
def test_no_process_that_others_reach_sees_the_key_of_the_authority(name: str) -> None:
    service = unit(FOLDER / f"{name}.service")["Service"]
    words = shlex.split(service["ExecStart"])
    folder = words[words.index("--security") + 1]
    assert service["InaccessiblePaths"] == f"-{folder}/ca.key"
