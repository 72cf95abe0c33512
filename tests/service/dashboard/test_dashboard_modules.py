"""Run the unit tests of the page's modules with node."""

import shutil
import subprocess
from pathlib import Path

import pytest

from support.patience import PATIENCE_S

HERE = Path(__file__).parent


@pytest.mark.parametrize("file", sorted(HERE.glob("*.test.mjs")), ids=lambda file: file.name.removesuffix(".test.mjs"))
def test_the_unit_tests_of_a_module_pass(file: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the unit tests of the page's modules need it (the page itself does not)")
    run = subprocess.run([node, "--test", str(file)], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
