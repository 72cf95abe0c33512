"""Run the lines of the guide for a release, a later one and the first again: each replaces the one before."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from release.build import build
from release.version import version
from support.guides import blocks_of, run
from support.service import ROOT

LATER = "99.0.1"
OF_OURS_ALONE = "export PIP_NO_DEPS=1 PIP_NO_INDEX=1\n"
_BUILD = "import sys; from pathlib import Path; from release.build import build; build(Path(sys.argv[1]))"


@pytest.fixture(scope="module")
def releases(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return a folder with this release, one with a later one, and the first again."""
    folder = tmp_path_factory.mktemp("releases")
    clone, first, second = folder / "clone", folder / "first", folder / "second"
    subprocess.run(["git", "clone", "--quiet", "--shared", str(ROOT), str(clone)], check=True)
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.split("\0")[:-1]:  # what is in no commit yet belongs to it, too
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, clone / name)
    build(first)
    run(f"cd {clone}/deploy; python -m release.version {LATER}; python -c '{_BUILD}' {second}", folder, PYTHONPATH=".")
    return [first, second, first]


def lines(heading: str) -> str:
    """Return the lines below a heading of the guide, without what would run until it is stopped."""
    text = "".join(block.text for block in blocks_of("install-a-release.md", heading))
    return "".join(line for line in text.splitlines(keepends=True) if not line.endswith(" demo\n"))


@pytest.mark.parametrize(
    ("heading", "before"),
    [
        ("In an environment of your own", OF_OURS_ALONE),
        pytest.param("In an environment of your own", "", marks=pytest.mark.installation),
        pytest.param("With pipx", "", marks=pytest.mark.installation),
    ],
    ids=["pip", "pip-with-all-it-needs", "pipx"],
)
def test_the_lines_of_the_guide_install_a_release_over_another(
    releases: list[Path], tmp_path: Path, heading: str, before: str
) -> None:
    if heading == "With pipx":
        before = f"export PATH={tmp_path}/pipx/bin:$PATH\n"
        run(f"{sys.executable} -m venv pipx; pipx/bin/pip install --quiet pipx", tmp_path)
    found = []
    for release in releases:
        run(f"export HOME={tmp_path}; unset PYTHONPATH\n{before}{lines(heading)}", release)
        found.append({info.name.split("-")[1] for info in tmp_path.rglob("dropanchor_*.dist-info")})
    assert found == [{f"{one}.dist"} for one in (version(), LATER, version())]
