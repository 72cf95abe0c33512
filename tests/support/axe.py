"""The accessibility checker axe-core. It is downloaded from npm once per run and never stored in the repository."""

import fcntl
import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest
from playwright.sync_api import Page

from support.browser import every_look
from support.patience import PATIENCE_S

_PACKAGE = "axe-core@4.10.3"
_CHECKS = ("any", "all", "none")
_RULES: tuple[dict[str, object], ...] = ({}, {"runOnly": ["color-contrast"]}, {})
"""Options for each look. The tablet's has the elements of the first one in other colours, so only these are checked."""


def axe_source(folder: Path) -> str:
    """Return the text of the script, and keep it in the folder. One process downloads it while the others wait.

    Skip the test where npm or its registry is missing.
    """
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        script = folder / "axe.min.js"
        if not script.is_file():
            script.write_bytes(_downloaded(folder))
        return script.read_text()


def _downloaded(folder: Path) -> bytes:
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("npm is not installed: the accessibility tests fetch axe-core with it")
    command = [npm, "pack", _PACKAGE, "--silent", "--pack-destination", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    except subprocess.TimeoutExpired:
        pytest.skip("npm did not deliver axe-core within 120 s: the accessibility tests need it")
    packed = list(folder.glob("axe-core-*.tgz"))
    if done.returncode or not packed:
        pytest.skip(f"npm did not deliver axe-core: the accessibility tests need it. {done.stderr.strip()[-300:]}")
    with tarfile.open(packed[0]) as archive:
        script = archive.extractfile("package/axe.min.js")
        assert script is not None
        return script.read()


def violations(page: Page, axe: str, within: str = "html") -> list[str]:
    """Return the violations that axe-core finds in every look of a page, each with its rule, element and reason.

    within: what has changed since the whole page was checked. It takes a small part of the time.
    """
    if not page.evaluate("'axe' in window"):
        page.evaluate(axe)
    return [
        f"{look}: {rule['id']}: {node['target']} {[one['message'] for kind in _CHECKS for one in node[kind]]}"
        for look, rules in zip(every_look(page), _RULES, strict=True)
        for rule in page.evaluate(
            "([part, rules]) => axe.run(part, { reporter: 'no-passes', ...rules }).then((found) => found.violations)",
            [within, rules],
        )
        for node in rule["nodes"]
    ]
