"""Kernels that were compiled elsewhere: the distribution `dropanchor-kernels` has those of one release.

numba keeps compiled code for one processor, and finds it by the folder of its source. Here it is compiled for a family
of processors instead, which gives the same bits, and copied to where numba looks for it.
"""

import hashlib
import importlib.util
import os
import platform
import shutil
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Final

from dropanchor_service.runtime.kernel_files import DIRECTORY_MODE, NOT_OF_OTHERS

CPU, FEATURES = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"
PACKAGE: Final = "dropanchor_kernels"
MADE_FOR: Final = "made-for.txt"

X86_64_V3: Final = "x86-64-v3"
_NEEDED: Final = frozenset({"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"})  # as Linux names them


def family(cpuinfo: Path = Path("/proc/cpuinfo")) -> str | None:
    """Return the family that this processor belongs to, as LLVM calls it; None where no family is known."""
    if platform.machine() != "x86_64":
        return None
    try:
        flags = next(line for line in cpuinfo.read_text().splitlines() if line.startswith("flags"))
    except (OSError, StopIteration):
        return None
    return X86_64_V3 if set(flags.split()) >= _NEEDED else None


def made_for(sources: str, processor: str | None) -> str:
    """Return what compiled code depends on. sources: their digest."""
    python = f"{sys.version_info[0]}.{sys.version_info[1]}"
    return f"sources {sources}, numba {version('numba')}, Python {python}, {processor}\n"


def shipped() -> Path | None:
    """Return the folder of the distribution, None where it is not installed."""
    found = importlib.util.find_spec(PACKAGE)
    return Path(found.origin).parent if found is not None and found.origin is not None else None


def copy_shipped(into: Path, needs: str, sources: Path) -> bool:
    """Copy the shipped kernels into a cache, if they are what is needed. Return whether they were. Raises OSError.

    needs: `made_for` of this process. sources: the package whose kernels they are.
    """
    origin = shipped()
    if origin is None or not (origin / MADE_FOR).is_file() or (origin / MADE_FOR).read_text() != needs:
        return False
    for folder, name in _folders(sources):
        if (origin / name).is_dir():
            _copy_files(origin / name, into / _name_in_cache(folder))
    return True


def collect(cache: Path, into: Path, needs: str, sources: Path) -> None:
    """Put the kernels of a full cache into the folder of the distribution."""
    into.mkdir(parents=True)
    for folder, name in _folders(sources):
        if (cache / _name_in_cache(folder)).is_dir():
            _copy_files(cache / _name_in_cache(folder), into / name)
    (into / MADE_FOR).write_text(needs)


def _copy_files(origin: Path, into: Path) -> None:
    """Copy the files of a folder without its permissions: an installation is often read-only, and a cache is not.

    Each appears whole: another process may copy the same, or read what it has copied.
    """
    into.mkdir(DIRECTORY_MODE, parents=True, exist_ok=True)
    for file in origin.iterdir():
        part = into / f"{file.name}.{os.getpid()}"
        shutil.copyfile(file, part)
        part.chmod(part.stat().st_mode & NOT_OF_OTHERS)
        part.replace(into / file.name)


def _folders(sources: Path) -> Iterator[tuple[Path, str]]:
    """Yield each folder of a package, and the name that it has in the distribution."""
    for folder in sorted(path for path in sources.rglob("*") if path.is_dir() and path.name != "__pycache__"):
        yield folder, ".".join(folder.relative_to(sources).parts)


def _name_in_cache(folder: Path) -> str:
    """Return the folder in which numba keeps the compiled code of the sources of a folder."""
    return f"{folder.name}_{hashlib.sha1(str(folder).encode(), usedforsecurity=False).hexdigest()}"
