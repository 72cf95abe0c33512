"""axe-core, the accessibility checker, from npm: it is asked for once per run and kept outside the repository."""

import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest
from playwright.sync_api import Page

_PACKAGE = "axe-core@4.10.3"


def axe_source(folder: Path) -> str:
    """The script, downloaded into a folder. Skips the test where npm is missing or its registry cannot be reached."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("npm is not installed: the accessibility tests fetch axe-core with it")
    asked = [npm, "pack", _PACKAGE, "--silent", "--pack-destination", str(folder)]
    try:
        done = subprocess.run(asked, capture_output=True, text=True, timeout=120, check=False)
    except subprocess.TimeoutExpired:
        pytest.skip("npm did not deliver axe-core within 120 s: the accessibility tests need it")
    packed = list(folder.glob("axe-core-*.tgz"))
    if done.returncode or not packed:
        pytest.skip(f"npm did not deliver axe-core: the accessibility tests need it. {done.stderr.strip()[-300:]}")
    with tarfile.open(packed[0]) as archive:
        script = archive.extractfile("package/axe.min.js")
        assert script is not None
        return script.read().decode()


def violations(page: Page, axe: str) -> list[str]:
    """What axe-core finds wrong on a page: rule, element and reason."""
    page.evaluate(axe)
    found = page.evaluate("axe.run(document, { resultTypes: ['violations'] })")
    return [
        f"{rule['id']}: {node['target']} {node['failureSummary']}"
        for rule in found["violations"]
        for node in rule["nodes"]
    ]
