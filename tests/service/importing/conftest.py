"""The command, in a folder of its own."""

from pathlib import Path

import pytest

from service.importing.command import Import


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Import:
    return Import(tmp_path, capsys)
