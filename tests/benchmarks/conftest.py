"""Nothing is measured while kernels are compiled."""

import subprocess

import pytest

from support.service import command, environment


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    subprocess.run(command("compile"), env=environment(), check=True)
