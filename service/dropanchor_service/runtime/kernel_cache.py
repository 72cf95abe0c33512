"""Choose the folder in which numba caches compiled kernels: `kernel_files` says what is taken from it.

numba checks only the source file of the outermost kernel. After an update of another file that the kernel calls into,
it would run the old code. Therefore the folder's name contains a digest of all sources.
"""

import atexit
import fcntl
import hashlib
import logging
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

from dropanchor_service.runtime.kernel_files import DIRECTORY_MODE, FORMAT, damaged_in, is_private
from dropanchor_service.runtime.shipped_kernels import CPU, FEATURES, copy_shipped, family, made_for, shipped

VARIABLE, LOCATOR = "NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"
ROOM = 16 << 20  # bytes, for all kernels
KERNEL_SOURCES = ("estimation", "ingest/kernels", "answers/kernels", "zones")
TEMPORARY = "dropanchor-kernels-"
_NOWHERE = Path(os.devnull, f"{TEMPORARY}nowhere")  # a place where nothing is found or kept
_LOCK = "lock"
_YOUNG_S = 60.0  # so long a folder without a lock may be one that another process just makes

_log = logging.getLogger(__name__)


def sources_digest() -> str:
    """Return a digest of all sources that define kernels, and of the format of their files."""
    return hashlib.sha256(b"".join([FORMAT, *(source.read_bytes() for source in _sources())])).hexdigest()[:16]


def mark_of(folder: Path, what: str = "complete") -> Path:
    """Return the file that says that the cache in a folder is full, or something else of it.

    numba compiles again for another version or processor, for other sources, and for sources that were moved.
    """
    if (processor := os.environ.get(CPU)) is None:
        from llvmlite.binding import get_host_cpu_name

        processor = get_host_cpu_name()
    place = hashlib.sha256(str(_package()).encode()).hexdigest()[:8]
    return folder / f"{what}-{version('numba')}-{platform.python_version()}-{processor}-{sources_digest()}-{place}"


def _package() -> Path:
    return Path(__file__).parents[1]


def _sources() -> list[Path]:
    return sorted(source for name in KERNEL_SOURCES for source in (_package() / name).rglob("*.py"))


def use_kernel_cache(data_dir: Callable[[], Path | None] = lambda: None) -> None:
    """Set the folder of the cache, unless the environment does. Call this before numba is imported.

    data_dir: returns the data folder of the service. It has the cache where there is no home.
    """
    use_processor_family()
    check_files()
    if (given := os.environ.get(VARIABLE)) and _is_usable(Path(given).resolve()):
        return
    name = f"kernels-{sources_digest()}"
    folder = _in_home(name) or _in_data(data_dir(), name) or _temporary()
    os.environ[VARIABLE] = str(folder)
    _take_shipped(folder)
    if folder.name.startswith(TEMPORARY) and not mark_of(folder).exists():
        _log.warning(
            "no folder keeps the compiled estimator, so it is compiled at every start: set a data folder (--data-dir), "
            "or %s to a writable folder",
            VARIABLE,
        )


def check_files() -> None:
    """Let numba check the files that it loads."""
    os.environ[LOCATOR] = "dropanchor_service.runtime.numba_cache.Place"


def use_processor_family() -> None:
    """Let numba compile for the family of this processor, unless the environment says for what."""
    if CPU not in os.environ and (found := family()) is not None:
        os.environ[CPU] = found
        os.environ[FEATURES] = ""  # what the family has, and nothing else of this processor


def is_full(folder: Path) -> bool:
    """Return whether a cache has all kernels, after deleting what is damaged and copying what is shipped."""
    mark = mark_of(folder)
    if mark.exists() and (damaged := damaged_in(folder)):
        _log.warning("%d files of the compiled estimator in %s are damaged, and are made anew", len(damaged), folder)
        with suppress(OSError):  # what stays is not used either
            for file in (mark, *damaged):
                file.unlink(missing_ok=True)
        _take_shipped(folder)
    return mark.exists()


def state_of(folder: Path) -> tuple[str, bool]:
    """Return what a cache holds, as a sentence, and whether a start can use it at once. It changes nothing."""
    if damaged := len(damaged_in(folder)):
        return (
            f"{damaged} files in {folder} are damaged: the next start makes them anew, in half a minute or more",
            False,
        )
    if mark_of(folder).exists():
        return f"{folder} has all of this version", True
    are_here = "are of another version, Python or processor" if shipped() else "are not installed"
    return (
        f"{folder} has not all of this version, and those that come compiled (dropanchor-kernels) {are_here}: the next "
        "start compiles, for half a minute or more; `dropanchor compile` does so before",
        False,
    )


def has_room(folder: Path, size: int = ROOM) -> bool:
    """Make the folder if there is none. Return whether so many bytes can be written into it."""
    try:
        folder.mkdir(DIRECTORY_MODE, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            os.posix_fallocate(probe.fileno(), 0, size)
    except OSError:
        return False
    return True


def _take_shipped(folder: Path) -> None:
    """Fill a cache that is not full with kernels that were compiled elsewhere, where they are for this process."""
    if CPU not in os.environ or shipped() is None or (mark := mark_of(folder)).exists():
        return
    try:
        if copy_shipped(folder, made_for(sources_digest(), os.environ[CPU]), _package()):
            mark.touch()
    except OSError as error:
        _log.warning("the kernels of the installation could not be copied (%s): they are compiled", error)


def is_kept() -> bool:
    """Return whether the next start finds what is compiled now."""
    folder = Path(os.environ.get(VARIABLE, _NOWHERE))
    return not folder.name.startswith(TEMPORARY) and has_room(folder)


def _in_home(name: str) -> Path | None:
    try:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:  # the user has none
        return None
    folder = home / "dropanchor" / name
    return folder if _is_usable(folder) else None


def _in_data(data_dir: Path | None, name: str) -> Path | None:
    if data_dir is None or not _is_usable(data_dir / name):
        return None
    for old in data_dir.glob("kernels-*"):  # of the version before an update
        if old.name != name:
            shutil.rmtree(old, ignore_errors=True)
    return data_dir / name


def _is_usable(folder: Path) -> bool:
    """Make the folder if there is none. Return whether it has the kernels or may be filled, and nobody else can write.

    The code in a cache is executed.
    """
    try:
        folder.mkdir(DIRECTORY_MODE, parents=True, exist_ok=True)
        if is_private(folder):
            return os.access(folder, os.W_OK, effective_ids=True) or mark_of(folder).exists()
    except OSError:
        return False
    _log.warning("%s is not used: it is not yours, or others can write into it, and its code would be executed", folder)
    return False


def _temporary() -> Path:
    """Return a fresh private folder that goes with this process. A lock tells others that the process lives."""
    try:
        _remove_left_over()
        folder = Path(tempfile.mkdtemp(prefix=TEMPORARY))
        fcntl.flock(os.open(folder / _LOCK, os.O_CREAT | os.O_RDWR, 0o600), fcntl.LOCK_EX)  # until the process ends
    except OSError:  # a full disk
        return _NOWHERE
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _remove_left_over() -> None:
    """Delete the temporary folders of this user whose process was killed."""
    for folder in Path(tempfile.gettempdir()).glob(f"{TEMPORARY}*"):
        with suppress(OSError):
            if is_private(folder) and time.time() - folder.stat().st_mtime > _YOUNG_S and _has_no_process(folder):
                shutil.rmtree(folder, ignore_errors=True)


def _has_no_process(folder: Path) -> bool:
    try:
        lock = os.open(folder / _LOCK, os.O_RDWR)
    except FileNotFoundError:
        return True
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(lock)
    return True
