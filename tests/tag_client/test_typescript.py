"""The TypeScript package passes its own tests, which read the golden frames and the OpenAPI document from here."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = Path("tag_client/typescript")
# Neither a lock file nor a report on packages is wanted, and a registry that is out of reach is found out soon.
QUIET = {"npm_config_fund": "false", "npm_config_audit": "false", "npm_config_fetch_retries": "0"}


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy beside what its tests read, with what it needs installed."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("npm is not installed: the TypeScript package needs it to be built and tested")
    copy = tmp_path / PACKAGE
    shutil.copytree(ROOT / PACKAGE, copy, ignore=shutil.ignore_patterns("node_modules", "dist", "openapi.ts"))
    for folder in ("schemas", "tests"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    installed = run(npm, "install", folder=copy)
    if installed.returncode != 0:
        pytest.skip(f"npm cannot install what the TypeScript package needs: {installed.stderr.strip()[-300:]}")
    return copy


def run(*command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | QUIET
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
    )


def test_the_typescript_package_passes_its_tests(package: Path) -> None:
    done = run("npm", "test", folder=package)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "# fail 0" in done.stdout, done.stdout
    assert not (package / "package-lock.json").exists()
