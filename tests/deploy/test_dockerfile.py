"""The steps of the image, run as a script in an empty folder: what they need is there, and the result runs."""

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
    "DROPANCHOR_IMAGE" not in os.environ, reason="installs and compiles everything anew: DROPANCHOR_IMAGE=1 runs it"
)
def test_the_steps_of_the_build_give_a_program_that_runs(tmp_path: Path) -> None:
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
    of = dict(final)
    assert of["USER"] == "dropanchor"
    assert [json.loads(of["ENTRYPOINT"]), json.loads(of["CMD"])] == [["dropanchor"], ["serve"]]
    assert of["STOPSIGNAL"] == "SIGTERM"


def stages() -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """The instructions of the two stages, with what they say."""
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
    for place in PLACES:
        text = text.replace(place, f"{folder}{place}")
    return text


def copy(source: Path, target: Path) -> None:
    """Of what git knows: a build context has no caches of ours, nor has an empty machine."""
    listed = subprocess.run(["git", "ls-files", "-z", source], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in listed.stdout.split("\0")[:-1]:
        place = target / (ROOT / name).relative_to(source) if source.is_dir() else target / Path(name).name
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, place)


def run(words: str, folder: Path, home: Path) -> str:
    """As in an empty environment, but for where packages come from."""
    kept = {name: value for name, value in os.environ.items() if name.startswith(("PIP_", "SSL_", "HTTP"))}
    clean = {"PATH": os.environ["PATH"], "HOME": str(home), **kept}
    done = subprocess.run(["sh", "-ec", words], cwd=folder, env=clean, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{words}\n{done.stderr[-3000:]}"
    return done.stdout
