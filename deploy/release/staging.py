"""Copy what is built into an empty folder, so that nothing else of a work tree gets into a release."""

import shutil
import subprocess
from pathlib import Path

from release.version import ROOT

FOLDERS = ("schemas", "tag_client", "service", "service/evaluation")
"""Folders of the distributions, in the order in which they need each other."""


def package_of(folder: str) -> str:
    """Return the name of the package in the folder of a distribution."""
    return f"dropanchor_{folder.rpartition('/')[2]}"


def stage(folder: str, into: Path, root: Path = ROOT) -> None:
    """Copy the files of a distribution that git tracks, as they are in the work tree, and the licence."""
    for name in _git("ls-files", "-z", folder, root=root).split("\0")[:-1]:
        target = into / Path(name).relative_to(folder)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(root / name, target)
        target.chmod(0o644)
    shutil.copyfile(root / "LICENSE", into / "LICENSE")


def last_commit_s(root: Path = ROOT) -> int:
    """Return the time of the last commit in seconds since 1970."""
    return int(_git("log", "-1", "--format=%ct", root=root))


def changed_files(root: Path = ROOT) -> list[str]:
    """Return the tracked files that differ from the last commit."""
    return _git("diff", "--name-only", "HEAD", root=root).splitlines()


def _git(*arguments: str, root: Path) -> str:
    return subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True).stdout
