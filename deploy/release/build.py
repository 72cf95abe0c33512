"""Build a release into a folder: `python -m release.build dist`.

It builds twice and refuses to go on when the two differ.
"""

import shutil
import sys
import tarfile
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

from dropanchor_service.runtime.shipped_kernels import PACKAGE as KERNELS
from release.hatch import hatch
from release.kernels import build_kernels
from release.licences import NAME as LICENCES
from release.licences import page
from release.needs import packages
from release.sbom import bill_of_materials
from release.staging import FOLDERS, changed_files, last_commit_s, package_of, stage
from release.version import ROOT, version

CHECKSUMS = "SHA256SUMS"


class DifferentBuildsError(Exception):
    """Two builds of the same files differ."""


def build(into: Path) -> None:
    """Build the files of a release from the tracked files of the work tree. A former release in the folder goes.

    Raises FileExistsError when the folder holds something else.
    """
    if into.exists() and any(into.iterdir()) and not (into / CHECKSUMS).is_file():
        raise FileExistsError(f"{into} holds other files than those of a release")
    shutil.rmtree(into, ignore_errors=True)
    into.mkdir(parents=True)
    (into / CHECKSUMS).touch()  # so that the next build may delete what a broken one leaves
    needed, time_s = packages(), last_commit_s()
    (into / LICENCES).write_text(page(needed), encoding="utf-8")
    wheels = {package_of(folder).replace("_", "-"): _build_distribution(folder, into, time_s) for folder in FOLDERS}
    bill = bill_of_materials(wheels, needed, version(), time_s)
    (into / f"dropanchor-{version()}.cdx.json").write_text(bill, encoding="utf-8")
    shutil.copyfile(ROOT / "LICENSE", into / "LICENSE")
    (into / "constraints.txt").write_text(_constraints(), encoding="utf-8")
    _write_checksums(into)


def _constraints() -> str:
    """Return the versions of all packages, ours first: pip then installs this release over a later or an older one."""
    ours = [f"{name}=={version()}" for name in (*(package_of(folder) for folder in FOLDERS), KERNELS)]
    lines = "\n".join(ours).replace("_", "-")
    return f"{lines}\n{(ROOT / 'constraints.txt').read_text(encoding='utf-8')}"


def _write_checksums(into: Path) -> None:
    (into / CHECKSUMS).write_text("".join(f"{sum_}  {name}\n" for name, sum_ in checksums(into).items()))


def _build_distribution(folder: str, into: Path, time_s: int) -> Path:
    """Build the sdist of a distribution, and the wheel out of the sdist. Return the wheel."""
    name = f"{package_of(folder)}-{version()}"
    with TemporaryDirectory() as place:
        staged, unpacked = Path(place) / "staged", Path(place) / "unpacked"
        stage(folder, staged)
        if folder == "service":
            shutil.copyfile(into / LICENCES, staged / LICENCES)
        hatch("sdist", staged, into, time_s)
        with tarfile.open(into / f"{name}.tar.gz") as archive:
            archive.extraction_filter = getattr(tarfile, "data_filter", None)  # Python 3.11.2 has none
            archive.extractall(unpacked)
        hatch("wheel", unpacked / name, into, time_s)
    return into / f"{name}-py3-none-any.whl"


def checksums(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in a folder but the list of them."""
    files = sorted(file for file in folder.iterdir() if file.name != CHECKSUMS)
    return {file.name: sha256(file.read_bytes()).hexdigest() for file in files}


def main(folder: str) -> None:
    into = Path(folder)
    build(into)
    with TemporaryDirectory() as place:
        again = Path(place) / "again"
        build(again)
        different = sorted({name for name, _ in checksums(into).items() ^ checksums(again).items()})
    if different:
        raise DifferentBuildsError(f"two builds differ in {', '.join(different)}: did a file change meanwhile?")
    if build_kernels(into) is None:
        print("No kernels are added: this processor belongs to no family that is known.", file=sys.stderr)
    _write_checksums(into)
    print((into / CHECKSUMS).read_text(), end="")
    print(f"{folder} holds Dropanchor {version()}, built twice with the same result.")
    if changed_files():
        print("It holds changes that are in no commit, so nobody can build it again.", file=sys.stderr)


if __name__ == "__main__":
    main(*sys.argv[1:])
