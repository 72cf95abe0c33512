"""Where the compiled kernels are kept for a user without a home, and that what is temporary goes away."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from dropanchor_service.engines.compilation import CompilationProgress
from dropanchor_service.runtime import kernel_cache
from dropanchor_service.runtime.kernel_cache import TEMPORARY, VARIABLE, use_kernel_cache
from service.data_folder import NOBODY, full_disk, without_rights
from support.patience import PATIENCE_S
from support.service import environment


@pytest.fixture(autouse=True)
def _without_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "temporary").mkdir()
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))


def started(tmp_path: Path, *options: str, **variables: str) -> "subprocess.Popen[str]":
    """Start a program that has read a command line of `serve` up to the import of the command, and waits."""
    clean = {name: value for name, value in environment(**variables).items() if name != VARIABLE}
    places = {"XDG_CACHE_HOME": str(tmp_path / "file"), "TMPDIR": str(tmp_path / "temporary")}
    code = f"import os, dropanchor_service.cli as cli; cli._parser(['compile'], {list(options)!r})"
    command = [sys.executable, "-c", f"{code}; print(os.environ['{VARIABLE}'], flush=True); input()"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, env=clean | places, text=True, **pipes)  # type: ignore[call-overload, no-any-return]


def folder_of(process: "subprocess.Popen[str]") -> Path:
    assert process.stdout is not None
    return Path(process.stdout.readline().strip())


@pytest.mark.parametrize("how", ["option", "file", "environment"])
def test_without_a_home_the_data_folder_keeps_the_kernels(tmp_path: Path, how: str) -> None:
    data = tmp_path / "data"
    (tmp_path / "yard.toml").write_text(f'data_dir = "{data}"\n')
    options = {"option": ["--data-dir", str(data)], "file": ["--config", str(tmp_path / "yard.toml")]}.get(how, [])
    variables = {"DROPANCHOR_DATA_DIR": str(data)} if how == "environment" else {}
    with started(tmp_path, "serve", *options, **variables) as process:
        folder = folder_of(process)
        _, said = process.communicate("\n")
    assert folder == data / f"kernels-{kernel_cache.sources_digest()}"
    assert folder.is_dir()
    assert said == ""


def test_the_data_folder_keeps_those_of_this_version_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "kernels-0123456789abcdef").mkdir()
    monkeypatch.setattr("os.environ", dict(os.environ))
    use_kernel_cache(lambda: tmp_path)
    assert [path.name for path in tmp_path.glob("kernels-*")] == [f"kernels-{kernel_cache.sources_digest()}"]


def give_away(folder: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can give a folder away")
    os.chown(folder, NOBODY, NOBODY)


def open_to_all(folder: Path) -> None:
    folder.chmod(0o777)


def replace_by_a_link(folder: Path) -> None:
    folder.rename(folder.with_name("elsewhere"))
    folder.symlink_to(folder.with_name("elsewhere"))


@pytest.mark.parametrize(
    ("place", "fault"),
    [
        *((place, fault) for place in ("home", "data") for fault in (give_away, open_to_all, replace_by_a_link)),
        *(("environment", fault) for fault in (give_away, open_to_all)),
    ],
)
def test_no_code_is_taken_from_a_folder_that_others_can_write(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    place: str,
    fault: Callable[[Path], None],
) -> None:
    where = {"home": tmp_path / "home" / "dropanchor", "data": tmp_path / "data", "environment": tmp_path / "given"}
    folder = where[place] / f"kernels-{kernel_cache.sources_digest()}"
    folder.mkdir(parents=True)
    variables = {"home": {"XDG_CACHE_HOME": str(tmp_path / "home")}, "environment": {VARIABLE: str(folder)}}
    monkeypatch.setattr("os.environ", {**os.environ, **variables.get(place, {})})
    use_kernel_cache(lambda: tmp_path / "data")
    assert os.environ[VARIABLE] == str(folder)
    fault(folder)
    if place != "environment":
        del os.environ[VARIABLE]
    use_kernel_cache(lambda: tmp_path / "data" if place == "data" else None)
    assert TEMPORARY in os.environ[VARIABLE]
    assert caplog.messages[0].startswith(f"{folder} is not used: it is not yours, or others can write into it")


@pytest.mark.parametrize("is_full", [True, False])
def test_a_folder_that_only_the_administrator_can_write_is_used_if_it_is_full(
    monkeypatch: pytest.MonkeyPatch, is_full: bool
) -> None:
    """An image has one, and a container whose disk is read-only."""
    with TemporaryDirectory(dir="/var/tmp") as home:  # tmp_path is in a folder of another user
        folder = Path(home, "user", "dropanchor", f"kernels-{kernel_cache.sources_digest()}")
        folder.mkdir(parents=True)
        if is_full:
            kernel_cache.mark_of(folder).touch()
        monkeypatch.setattr("os.environ", {**os.environ, "XDG_CACHE_HOME": str(Path(home, "user"))})
        with without_rights(Path(home, "user")):
            folder.chmod(0o555)
            use_kernel_cache()
        assert (os.environ[VARIABLE] == str(folder)) == is_full


def test_where_nothing_can_be_written_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.environ", dict(os.environ))
    monkeypatch.setattr("tempfile.tempdir", os.devnull)
    use_kernel_cache()
    assert not kernel_cache.is_kept()
    assert not kernel_cache.is_full(Path(os.environ[VARIABLE]))


def test_a_user_without_any_home_gets_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr("os.environ", dict(os.environ))
    use_kernel_cache()
    assert TEMPORARY in os.environ[VARIABLE]


def test_a_temporary_folder_is_private_and_goes_with_its_process(tmp_path: Path) -> None:
    with started(tmp_path) as first, started(tmp_path) as second:
        folders = folder_of(first), folder_of(second)
        assert folders[0] != folders[1]
        assert all(folder.name.startswith(TEMPORARY) for folder in folders)
        assert all(folder.stat().st_mode & 0o077 == 0 for folder in folders)
        _, said = first.communicate("\n")
        second.communicate("\n")
    assert "compiled at every start: set a data folder (--data-dir)" in said
    assert not any(folder.exists() for folder in folders)


def test_the_folder_of_a_killed_process_is_removed_and_that_of_a_living_one_is_not(tmp_path: Path) -> None:
    with started(tmp_path) as killed, started(tmp_path) as living:
        left, used = folder_of(killed), folder_of(living)
        killed.send_signal(signal.SIGKILL)
        killed.wait(PATIENCE_S)
        assert left.exists()
        for folder in (left, used):
            long_ago = time.time() - 3600.0
            os.utime(folder, (long_ago, long_ago))
        with started(tmp_path) as third:
            folder_of(third)
            assert not left.exists()
            assert used.exists()
            third.communicate("\n")
        living.communicate("\n")


def test_what_is_compiled_at_every_start_is_not_said_to_happen_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    progress = CompilationProgress()
    progress.begin("the zones")
    monkeypatch.setenv(VARIABLE, f"/tmp/{TEMPORARY}x")
    assert progress.sentence.endswith("This happens at every start; the log says why.")
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    assert progress.sentence.endswith("This happens once after an update.")
    with full_disk():
        assert progress.sentence.endswith("This happens at every start; the log says why.")
