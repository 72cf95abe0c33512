"""The wheels of a release, installed as a stranger does it: no source tree, no home, an ordinary user.

`make test-dist` builds the release and runs this. It downloads what the service needs, and compiles the estimator once.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from release.build import CHECKSUMS
from release.version import version
from support.service import ROOT
from support.zenoh_router import free_endpoint, free_port, wait_until

pytestmark = pytest.mark.installation
DIST = ROOT / "dist"
NOBODY = 65534
COMPILING_S = 1800.0  # at most, on a busy machine
NOWHERE = "no folder keeps the compiled estimator, so it is compiled at every start"


@dataclass(frozen=True)
class Installation:
    """An environment with the wheels, and folders that its user may write: a cache and a data folder."""

    folder: Path

    @property
    def cache(self) -> Path:
        return self.folder / "cache"

    @property
    def data(self) -> Path:
        return self.folder / "data"

    def start(self, *words: str, **environment: str) -> subprocess.Popen[str]:
        """Start a program of the environment as an ordinary user. It has no variables but those that are passed."""
        program = [str(self.folder / "venv" / "bin" / words[0]), *words[1:]]
        user = {"user": NOBODY, "group": NOBODY, "extra_groups": []} if os.geteuid() == 0 else {}
        process: subprocess.Popen[str] = subprocess.Popen(
            program,
            cwd="/",
            env={"PATH": os.defpath, "TMPDIR": str(self.folder / "tmp"), **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            **user,  # type: ignore[call-overload]
        )
        return process

    def run(self, *words: str) -> str:
        with self.start(*words) as process:
            output, _ = process.communicate(timeout=240.0)
        assert process.returncode == 0, output
        return output

    def files(self) -> set[Path]:
        return set((self.folder / "venv").rglob("*"))


@pytest.fixture(scope="module")
def installed() -> Iterator[Installation]:
    """Install the wheels of dist/ with their tested needs. Nobody but root can write into the environment."""
    assert (DIST / CHECKSUMS).is_file(), "there is no release in dist/: run make test-dist"
    folder = Path(tempfile.mkdtemp(prefix="dropanchor-installation-"))
    try:
        folder.chmod(0o755)
        venv = folder / "venv"
        subprocess.run([interpreter(), "-m", "venv", "--without-pip", str(venv)], check=True)
        options = ["--quiet", "--constraint", str(DIST / "constraints.txt"), "--find-links", str(DIST)]
        install = [sys.executable, "-m", "pip", "--python", str(venv / "bin" / "python"), "install", *options]
        subprocess.run([*install, f"dropanchor-service=={version()}"], check=True, timeout=1200.0, env=without_paths())
        subprocess.run(["chmod", "-R", "a-w,a+rX", str(venv)], check=True)
        for name in ("cache", "data", "tmp"):
            (folder / name).mkdir()
            (folder / name).chmod(0o700)
            if os.geteuid() == 0:
                os.chown(folder / name, NOBODY, NOBODY)
        yield Installation(folder)
    finally:
        subprocess.run(["chmod", "-R", "u+w", str(folder)], check=True)
        shutil.rmtree(folder)


def interpreter() -> str:
    """Return a Python 3.11 or newer that an ordinary user can run. Skip the tests where there is none."""
    user = {"user": NOBODY, "group": NOBODY} if os.geteuid() == 0 else {}
    new_enough = "import sys; sys.exit(sys.version_info < (3, 11))"
    for program in (os.path.realpath(sys.executable), "/usr/bin/python3", "/usr/local/bin/python3"):
        try:
            ended = subprocess.run([program, "-I", "-c", new_enough], check=False, **user)  # type: ignore[call-overload]
            if ended.returncode == 0:
                return program
        except OSError:  # not there, or not for this user
            continue
    pytest.skip("no Python 3.11 or newer is to be had by an ordinary user")


def without_paths() -> dict[str, str]:
    """Return this environment without what leads Python to a source tree."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


@contextmanager
def running(process: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
        process.communicate()


def status(url: str) -> int:
    try:
        return httpx.get(url, trust_env=False, timeout=60.0).status_code
    except httpx.TransportError:
        return 0


def test_the_commands_answer(installed: Installation) -> None:
    assert installed.run("dropanchor", "--version") == f"dropanchor {version()}\n"
    assert "serve" in installed.run("dropanchor", "--help")
    assert version() in installed.run("dropanchor-tag", "--version")


def test_what_is_installed_comes_from_the_wheels(installed: Installation) -> None:
    where = "import dropanchor_service, dropanchor_schemas, dropanchor_tag_client as t; print(t.__file__)"
    assert installed.run("python", "-c", where).startswith(str(installed.folder / "venv" / "lib"))


def test_what_measures_the_service_is_named_where_it_is_not_installed(installed: Installation) -> None:
    with installed.start("dropanchor", "evaluate", "paper") as process:
        output, _ = process.communicate(timeout=240.0)
    assert process.returncode == 2
    assert "pip install 'dropanchor-service[evaluation]'" in output


def test_a_service_that_can_write_nowhere_says_so_and_what_to_do(installed: Installation) -> None:
    url = f"http://127.0.0.1:{free_port()}"
    words = ("serve", "--port", url.rpartition(":")[2], "--zenoh-listen", free_endpoint())
    with running(installed.start("dropanchor", *words)) as process:
        assert process.stdout is not None
        found = next(line for line in process.stdout if NOWHERE in line)
        assert "--data-dir" in found
        wait_until(lambda: status(f"{url}/") == 200, 240.0)  # it serves the page while it compiles
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 0


def test_the_demo_shows_poses_and_writes_only_into_the_cache(installed: Installation) -> None:
    before, url = installed.files(), f"http://127.0.0.1:{free_port()}"
    words = ("dropanchor", "demo", "--port", url.rpartition(":")[2], "--zenoh-listen", free_endpoint())
    began_s = time.monotonic()
    with running(installed.start(*words, XDG_CACHE_HOME=str(installed.cache))) as process:
        wait_until(lambda: status(f"{url}/") == 200, 240.0)
        page_s = time.monotonic() - began_s
        wait_until(lambda: status(f"{url}/api/v1/health/ready") == 200, COMPILING_S)
        ready_s = time.monotonic() - began_s
        page = httpx.get(f"{url}/", trust_env=False).text
        for script in re.findall(r'<script[^>]+src="([^"]+)"', page):
            assert status(f"{url}/{script.removeprefix('./').lstrip('/')}") == 200, script
        assert status(f"{url}/docs/") == status(f"{url}/api/v1/openapi.json") == 200
        wait_until(lambda: len(httpx.get(f"{url}/api/v1/poses", trust_env=False).json()["poses"]) > 0, 60.0)
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0
    print(f"\nfirst start from the wheels: the page after {page_s:.1f} s, ready after {ready_s:.1f} s")
    assert installed.files() == before
    (kernels,) = (installed.cache / "dropanchor").iterdir()
    assert kernels.name.startswith("kernels-")


def test_with_the_kernels_the_first_start_compiles_nothing(installed: Installation) -> None:
    """The distribution lies in a folder of its own, so that the other tests go on without it."""
    wheels = list(DIST.glob("dropanchor_kernels-*.whl"))
    if not wheels:
        pytest.skip("this release has no kernels: the processor that built it belongs to no family that is known")
    kernels, home = installed.folder / "kernels", installed.cache / "another"
    python = str(installed.folder / "venv" / "bin" / "python")
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--target"]
    subprocess.run([*install, str(kernels), str(wheels[0])], check=True, env=without_paths())
    subprocess.run(["chmod", "-R", "a-w,a+rX", str(kernels)], check=True)
    url = f"http://127.0.0.1:{free_port()}"
    words = ("dropanchor", "demo", "--port", url.rpartition(":")[2], "--zenoh-listen", free_endpoint())
    began_s = time.monotonic()
    process = installed.start(*words, XDG_CACHE_HOME=str(home), PYTHONPATH=str(kernels))
    with running(process):
        wait_until(lambda: status(f"{url}/api/v1/health/ready") == 200, 240.0)
        wait_until(lambda: len(httpx.get(f"{url}/api/v1/poses", trust_env=False).json()["poses"]) > 0, 60.0)
        print(f"\nfirst start with the kernels: poses after {time.monotonic() - began_s:.1f} s")
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60.0)
    assert process.returncode == 0
    assert "compil" not in output


def test_without_a_home_the_data_folder_keeps_the_compiled_estimator(installed: Installation) -> None:
    """What the demo has compiled is moved there, so this start finds it: compiling once is enough for both."""
    (kernels,) = (installed.cache / "dropanchor").iterdir()
    subprocess.run(["cp", "-a", str(kernels), str(installed.data)], check=True)
    url = f"http://127.0.0.1:{free_port()}"
    words = ("serve", "--data-dir", str(installed.data), "--port", url.rpartition(":")[2])
    began_s = time.monotonic()
    process = installed.start("dropanchor", *words, "--zenoh-listen", free_endpoint())
    with running(process):
        wait_until(lambda: status(f"{url}/api/v1/health/ready") == 200, 240.0)
        print(f"\nnext start: ready after {time.monotonic() - began_s:.1f} s")
        process.send_signal(signal.SIGTERM)
        output, _ = process.communicate(timeout=60.0)
    assert process.returncode == 0
    assert "compil" not in output
