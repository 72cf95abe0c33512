"""The build steps of the image run in an empty folder and give a program that starts."""

import json
import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from support.patience import PATIENCE_S
from support.service import ROOT, command, environment, running_service
from support.zenoh_router import free_port

DOCKERFILE = ROOT / "deploy" / "Dockerfile"
PLACES = ("/src", "/opt/dropanchor", "/var/cache", "/var/lib/dropanchor")


@pytest.mark.skipif(
    "DROPANCHOR_IMAGE" not in os.environ,
    reason="installs and compiles everything from scratch: set DROPANCHOR_IMAGE=1 to run it",
)
def test_the_build_steps_give_a_program_that_runs(tmp_path: Path) -> None:
    build, final = stages()
    folder = tmp_path / "src"
    for instruction, words in build:
        match instruction:
            case "COPY":
                copy(ROOT / words.split()[0], folder / words.split()[1])
            case "RUN":
                run(inside(words, tmp_path), folder, tmp_path)
    for instruction, words in final:
        if instruction == "COPY":
            source = words.split()[-2]
            assert any(Path(inside(source, tmp_path)).iterdir()), f"{source} is empty"
    program = Path(inside("/opt/dropanchor/bin/dropanchor", tmp_path))
    assert "serve" in run(f"{program} --help", tmp_path, tmp_path)
    shutil.rmtree(tmp_path / "opt")  # 700 MB


def test_the_image_does_not_run_as_root_and_starts_the_service_by_default(tmp_path: Path) -> None:
    _, final = stages()
    instruction = dict(final)
    assert instruction["USER"] == "dropanchor"
    assert [json.loads(instruction["ENTRYPOINT"]), default_command(tmp_path)[0]] == [["dropanchor"], "serve"]
    assert instruction["STOPSIGNAL"] == "SIGTERM"


def test_the_image_alone_refuses_to_be_open_to_the_network_and_says_what_to_do(tmp_path: Path) -> None:
    words = command(*default_command(tmp_path))
    done = subprocess.run(words, env=environment(), capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 2
    assert "would be open to the network without credentials" in done.stderr
    assert "DROPANCHOR_INSECURE=true" in done.stderr


def test_the_image_listens_on_all_addresses_and_keeps_data_in_its_volume(tmp_path: Path) -> None:
    _, *options = default_command(tmp_path)
    for is_new in (True, False):
        with running_service(*options, "--insecure") as service:
            elsewhere = service.url.replace("0.0.0.0", "127.0.0.2")
            if is_new:
                httpx.put(f"{elsewhere}/api/v1/anchors/7", json={"id": "7"}, trust_env=False).raise_for_status()
            site = httpx.get(f"{elsewhere}/api/v1/site", trust_env=False).json()
            assert [anchor["id"] for anchor in site["anchors"]] == ["7"]
            port = service.get("/api/v1/connect")["endpoints"][0].rpartition(":")[2]
            socket.create_connection(("127.0.0.2", int(port))).close()


def default_command(folder: Path) -> list[str]:
    """Return what the image runs unless told otherwise, on a free port of Zenoh, with its volume in a folder."""
    instruction = dict(stages()[1])
    volume = instruction["VOLUME"]
    words = json.loads(instruction["CMD"])
    assert volume in words
    return [inside(word, folder).replace(":7447", f":{free_port()}") for word in words]


def stages() -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return the instructions of the two stages, each with its arguments."""
    found: list[list[tuple[str, str]]] = []
    for instruction, words in instructions():
        if instruction == "FROM":
            found.append([])
        found[-1].append((instruction, words))
    build, final = found
    return build, final


def instructions() -> Iterator[tuple[str, str]]:
    for line in DOCKERFILE.read_text().replace("\\\n", " ").splitlines():
        if line and not line.startswith("#"):
            instruction, _, words = line.partition(" ")
            yield instruction, words


def inside(text: str, folder: Path) -> str:
    """Move the absolute paths in a text below the folder."""
    for place in PLACES:
        text = text.replace(place, f"{folder}{place}")
    return text


def copy(source: Path, target: Path) -> None:
    """Copy the files that git tracks, since a build context has no caches either."""
    listed = subprocess.run(["git", "ls-files", "-z", source], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in listed.stdout.split("\0")[:-1]:
        place = target / (ROOT / name).relative_to(source) if source.is_dir() else target / Path(name).name
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, place)


def run(words: str, folder: Path, home: Path) -> str:
    """Run a shell command with an empty environment but for pip and network settings. Return its output."""
    kept = {name: value for name, value in os.environ.items() if name.startswith(("PIP_", "SSL_", "HTTP"))}
    clean = {"PATH": os.environ["PATH"], "HOME": str(home), **kept}
    done = subprocess.run(["sh", "-ec", words], cwd=folder, env=clean, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{words}\n{done.stderr[-3000:]}"
    return done.stdout
