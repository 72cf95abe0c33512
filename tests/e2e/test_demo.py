"""The demo shows moving tags within seconds and leaves no process behind when it stops."""

import os
import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from support.patience import PATIENCE_S
from support.recordings import write_square
from support.service import command, ended, environment
from support.zenoh_router import free_endpoint, wait_until


@contextmanager
def running_demo(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the demo in a process group of its own. Yield the process and the address of the page."""
    process = subprocess.Popen(
        command("demo", "--port", "0", "--zenoh-listen", free_endpoint(), *arguments),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        found = re.search(r"(http://\S+)/\n", process.stdout.readline())
        assert found, process.communicate(timeout=PATIENCE_S)
        yield process, found[1]
    finally:
        for child in children(process.pid):
            os.kill(child, signal.SIGKILL)
        if process.poll() is None:
            process.kill()
        process.communicate()


def children(pid: int) -> list[int]:
    """Return the ids of the child processes."""
    path = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(child) for child in path.read_text().split()] if path.exists() else []


def poses(url: str) -> dict[str, dict[str, Any]]:
    return {pose["tag"]: pose for pose in httpx.get(f"{url}/api/v1/poses", verify=False).json()["poses"]}


def test_the_demo_shows_moving_tags_and_ctrl_c_ends_all_its_processes() -> None:
    with running_demo("--tags", "3") as (process, url):
        wait_until(lambda: len(poses(url)) == 3)
        before = poses(url)
        wait_until(
            lambda: all(
                abs(pose["x"] - before[tag]["x"]) + abs(pose["y"] - before[tag]["y"]) > 1.0
                for tag, pose in poses(url).items()
            )
        )
        wait_until(lambda: {pose["state"] for pose in poses(url).values()} == {"tracking"})
        assert "<html" in httpx.get(url, verify=False).text.lower()
        (tags,) = children(process.pid)
        os.killpg(process.pid, signal.SIGINT)  # what a terminal sends on Ctrl-C
        assert process.wait(PATIENCE_S) == 0
        assert not Path(f"/proc/{tags}").exists()


def test_the_demo_ends_with_a_sentence_when_its_tags_die() -> None:
    with running_demo("--tags", "1") as (process, _):
        (tags,) = children(process.pid)
        os.kill(tags, signal.SIGKILL)
        assert process.wait(PATIENCE_S) == 1
        assert process.stderr is not None
        assert "the simulated tags or the service ended by themselves" in process.stderr.read()


def test_a_recording_is_replayed_as_a_live_tag_and_the_page_remains_after_its_end(tmp_path: Path) -> None:
    write_square(tmp_path)
    for name in ("range", "heading"):  # keep the first 6 s: ranges that report no deviation are not believed before
        path = tmp_path / f"{name}.csv"
        lines = path.read_text().splitlines()
        path.write_text("\n".join([lines[0], *(line for line in lines[1:] if float(line.split(",")[0]) < 6.0)]) + "\n")
    with running_demo("--recording", str(tmp_path), "--engine", "fleet") as (process, url):
        wait_until(lambda: tmp_path.name in poses(url) and poses(url)[tmp_path.name]["y"] > 2.0)
        assert poses(url)[tmp_path.name]["x"] == pytest.approx(10.0, abs=0.5)
        wait_until(lambda: poses(url)[tmp_path.name]["age_s"] > 1.5)
        assert process.poll() is None
        assert httpx.get(url, verify=False).status_code == 200
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0


def test_a_missing_recording_is_reported_and_the_data_folder_kept_private(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    (tmp_path / "site.json").touch(mode=0o644)
    options = ("--recording", "nowhere", "--data-dir", str(tmp_path))
    found = ended("demo", *options)
    assert found.returncode == 2
    assert "nowhere is not a folder" in found.stderr
    assert (tmp_path / "site.json").stat().st_mode & 0o077 == 0


def test_tags_with_an_unknown_start_are_ambiguous_at_first() -> None:
    with running_demo("--tags", "2", "--unknown-start") as (_, url):
        pose, *_ = wait_until(lambda: [pose for pose in poses(url).values() if pose["hypotheses"]])
        assert pose["state"] == "ambiguous"
        assert sum(mode["weight"] for mode in pose["hypotheses"]) <= 1.0 + 1e-9
