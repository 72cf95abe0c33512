"""Choose the folder in which numba caches compiled kernels.

numba checks only the source file of the outermost kernel. After an update of another file that the kernel calls into,
it would run the old code. Therefore the folder's name contains a digest of all sources.
"""

import hashlib
import logging
import os
import tempfile
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
KERNEL_SOURCES = ("estimation", "ingest/kernels", "answers/kernels", "zones")

_log = logging.getLogger(__name__)


def sources_digest() -> str:
    """Return a digest of all sources that define kernels."""
    return hashlib.sha256(b"".join(source.read_bytes() for source in _sources())).hexdigest()[:16]


def sources_stamp() -> str:
    """Return a digest of where the sources of the kernels are and when each was written."""
    stamps = [(str(source), source.stat().st_mtime_ns) for source in _sources()]
    return hashlib.sha256(repr(stamps).encode()).hexdigest()[:8]


def _sources() -> list[Path]:
    return sorted(source for name in KERNEL_SOURCES for source in (Path(__file__).parents[1] / name).rglob("*.py"))


def use_kernel_cache() -> None:
    """Set the folder of the cache, unless the environment does. Call this before numba is imported."""
    if VARIABLE in os.environ:
        return
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = home / "dropanchor" / f"kernels-{sources_digest()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        writable = os.access(folder, os.W_OK)
    except OSError:
        writable = False
    if not writable:
        # Use a fresh private folder: the code in a cache is executed, so nobody else may have written it.
        folder = Path(tempfile.mkdtemp(prefix="dropanchor-kernels-"))
        _log.warning(
            "%s is not writable, so the estimator is compiled at every start: set %s to a writable folder",
            home,
            VARIABLE,
        )
    os.environ[VARIABLE] = str(folder)
