"""The files of a release: all that is needed, nothing else, and the same bytes from every build.

And the lines of the guide for a release, a later one and the first again: each replaces the one before.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
from email import message_from_bytes
from email.message import Message
from hashlib import sha256
from pathlib import Path
from zipfile import ZipFile

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

from release.build import CHECKSUMS, DifferentBuildsError, build, checksums, main
from release.licences import NAME as LICENCES
from release.needs import own, packages, pins
from release.staging import FOLDERS, package_of, stage
from release.version import version
from support.guides import blocks_of, run
from support.service import ROOT

LATER = "99.0.1"
OF_OURS_ALONE = "export PIP_NO_DEPS=1 PIP_NO_INDEX=1\n"
_BUILD = "import sys; from pathlib import Path; from release.build import build; build(Path(sys.argv[1]))"
NOTICES = re.compile(rb"@license|SPDX-License-Identifier|copyright \(c\)|permission is hereby granted", re.IGNORECASE)


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("release") / "dist"
    build(folder)
    return folder


def wheel(dist: Path, folder: str) -> ZipFile:
    return ZipFile(dist / f"{package_of(folder)}-{version()}-py3-none-any.whl")


def metadata(dist: Path, folder: str) -> Message:
    return message_from_bytes(wheel(dist, folder).read(f"{package_of(folder)}-{version()}.dist-info/METADATA"))


def tracked(folder: str, part: str = "") -> set[str]:
    """Return the files of a distribution, or of a part of it, as they are called in its folder."""
    words = ["git", "ls-files", f"{folder}/{part}"]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    others = tuple(f"{other}/" for other in FOLDERS if other.startswith(f"{folder}/"))
    names = (name for name in listed.stdout.splitlines() if not name.startswith(others))
    return {name.removeprefix(f"{folder}/") for name in names}


def test_a_second_build_elsewhere_gives_the_same_bytes(
    dist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TZ", "Pacific/Auckland")
    monkeypatch.setenv("PYTHONHASHSEED", "4")
    before = os.umask(0o077)
    try:
        build(tmp_path / "again")
    finally:
        os.umask(before)
    assert checksums(tmp_path / "again") == checksums(dist)


def test_the_checksums_are_those_of_the_files(dist: Path) -> None:
    lines = [line.split("  ") for line in (dist / CHECKSUMS).read_text().splitlines()]
    assert {name: sum_ for sum_, name in lines} == {
        file.name: sha256(file.read_bytes()).hexdigest() for file in dist.iterdir() if file.name != CHECKSUMS
    }
    assert len(lines) == 2 * len(FOLDERS) + 4


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_wheel_holds_every_file_of_its_package_and_no_other(dist: Path, folder: str) -> None:
    """So it has the page, the schemas, `py.typed` and whatever else the package reads, and no tests."""
    package = package_of(folder)
    info = f"{package}-{version()}.dist-info"
    names = {name for name in wheel(dist, folder).namelist() if not name.startswith(info)}
    pages = {f"dropanchor_service/{page}" for page in tracked("service", "docs")} if folder == "service" else set()
    assert names == tracked(folder, package) | pages
    assert f"{package}/py.typed" in names
    licences = {name for name in wheel(dist, folder).namelist() if name.startswith(f"{info}/licenses/")}
    expected = ["LICENSE", *([LICENCES] if folder == "service" else [])]
    assert licences == {f"{info}/licenses/{name}" for name in expected}


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_source_distribution_holds_every_file_of_its_folder(dist: Path, folder: str) -> None:
    top = f"{package_of(folder)}-{version()}/"
    with tarfile.open(dist / f"{top[:-1]}.tar.gz") as archive:
        names = {name.removeprefix(top) for name in archive.getnames()}
    assert tracked(folder) | {"LICENSE"} <= names
    assert not any(name.startswith("evaluation/") for name in names)


def test_no_file_names_a_place_on_this_machine(dist: Path) -> None:
    places = [str(ROOT).encode(), str(Path.home()).encode() + b"/", str(dist.parent).encode()]
    for folder in FOLDERS:
        files = wheel(dist, folder)
        assert [name for name in files.namelist() if any(place in files.read(name) for place in places)] == []


def test_the_wheels_hold_no_code_of_others(dist: Path) -> None:
    """Whoever adds such a file has to name its licence in the page of licences, which says that there is none."""
    for folder in FOLDERS:
        files = wheel(dist, folder)
        foreign = [name for name in files.namelist() if "dist-info" not in name and NOTICES.search(files.read(name))]
        assert foreign == []


def test_a_file_that_git_does_not_track_stays_out(tmp_path: Path) -> None:
    root, staged = tmp_path / "clone", tmp_path / "staged"
    (root / "schemas").mkdir(parents=True)
    for name in ("LICENSE", "schemas/keys.py", "schemas/notes.txt"):
        (root / name).write_text("")
    for words in (["init", "--quiet"], ["add", "schemas/keys.py"]):
        subprocess.run(["git", *words], cwd=root, check=True)
    stage("schemas", staged, root)
    assert {file.name for file in staged.iterdir()} == {"LICENSE", "keys.py"}


def test_builds_that_differ_are_refused_and_the_files_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def another_each_time(into: Path) -> None:
        into.mkdir()
        (into / CHECKSUMS).touch()
        (into / "same.whl").write_bytes(b"")
        (into / "other.whl").write_text(into.name)

    monkeypatch.setattr("release.build.build", another_each_time)
    with pytest.raises(DifferentBuildsError, match=r"differ in other\.whl:"):
        main(str(tmp_path / "dist"))


def test_other_files_than_those_of_a_release_are_not_deleted(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("kept")
    with pytest.raises(FileExistsError, match="other files"):
        build(tmp_path)
    assert (tmp_path / "thesis.txt").read_text() == "kept"


@pytest.mark.parametrize("folder", FOLDERS)
def test_the_distributions_need_each_other_in_the_same_version(dist: Path, folder: str) -> None:
    found = metadata(dist, folder)
    assert (found["Version"], found["License-Expression"]) == (version(), "Apache-2.0")
    ours = [line for line in found.get_all("Requires-Dist", []) if line.startswith("dropanchor-")]
    assert all(line.partition(";")[0].endswith(f"=={version()}") for line in ours)
    assert len(ours) == {"schemas": 0, "tag_client": 1, "service": 3, "service/evaluation": 1}[folder]


def test_the_bill_of_materials_is_valid_and_names_the_wheels(dist: Path) -> None:
    text = (dist / f"dropanchor-{version()}.cdx.json").read_text(encoding="utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    for name in checksums(dist):
        if name.endswith(".whl"):
            assert checksums(dist)[name] in text


def test_the_packages_that_the_service_needs_are_listed_with_their_licences(dist: Path) -> None:
    found = {one.name: one for one in packages()}
    assert found["numba"].extras == ()
    assert found["ray"].extras == ("dropanchor-service[cluster]",)
    assert found["sympy"].extras == ("dropanchor-service[evaluation]",)
    assert found["gtsam"].extras == ("dropanchor-service[recordings]",)
    assert found["adafruit-extended-bus"].extras == ("dropanchor-tag-client[imu]",)
    assert "llvmlite" in found["numba"].needs
    page = wheel(dist, "service").read(f"dropanchor_service-{version()}.dist-info/licenses/{LICENCES}").decode()
    for name, one in found.items():
        assert one.version == pins()[name]
        assert f"| {name} | {one.version} | {one.licence} |" in page
        assert one.licence != "see the package"
    assert not found.keys() & own().keys()


@pytest.fixture(scope="module")
def releases(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return a folder with this release, one with a later one, and the first again."""
    folder = tmp_path_factory.mktemp("releases")
    clone, later = folder / "clone", folder / "later"
    subprocess.run(["git", "clone", "--quiet", "--shared", str(ROOT), str(clone)], check=True)
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.split("\0")[:-1]:  # what is in no commit yet belongs to it, too
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, clone / name)
    run(f"cd {clone}/deploy; python -m release.version {LATER}; python -c '{_BUILD}' {later}", folder, PYTHONPATH=".")
    return [dist, later, dist]


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
