"""The build steps of the image run in an empty folder and give a program that starts."""

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.service import ROOT

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


def test_the_image_does_not_run_as_root_and_starts_the_service_by_default() -> None:
    _, final = stages()
    instruction = dict(final)
    assert instruction["USER"] == "dropanchor"
    assert [json.loads(instruction["ENTRYPOINT"]), json.loads(instruction["CMD"])] == [["dropanchor"], ["serve"]]
    assert instruction["STOPSIGNAL"] == "SIGTERM"


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
