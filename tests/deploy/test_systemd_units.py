"""The units are valid and start programs with options that exist."""

import os
import shlex
import shutil
import subprocess
from configparser import ConfigParser
from pathlib import Path

import pytest

from support.commands import python
from support.service import ROOT

UNITS = sorted((ROOT / "deploy" / "systemd").glob("*.service"))
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
    for path in UNITS:
        (tmp_path / path.name).write_text(path.read_text().replace(INSTALLED, str(program)))
    verified = subprocess.run(
        ["systemd-analyze", "verify", *(str(tmp_path / path.name) for path in UNITS)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"SYSTEMD_LOG_LEVEL": "warning"},
    )
    ours = [line for line in verified.stderr.splitlines() if str(tmp_path) in line or "dropanchor" in line]
    assert not ours
    assert len(UNITS) == 2


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_the_program_has_every_option_that_a_unit_passes(path: Path) -> None:
    program, command, *options = shlex.split(unit(path)["Service"]["ExecStart"])
    assert program == INSTALLED
    text = python("-m", "dropanchor_service", command, "--help").stdout
    assert not [option for option in options if option.startswith("--") and option not in text]


def test_the_service_gets_time_to_stop_and_is_always_restarted() -> None:
    service = unit(ROOT / "deploy" / "systemd" / "dropanchor.service")["Service"]
    assert int(service["TimeoutStopSec"]) > 3
    assert service["Restart"] == "always"
    assert service["Type"] == "notify"
    assert "MemoryDenyWriteExecute" not in service
