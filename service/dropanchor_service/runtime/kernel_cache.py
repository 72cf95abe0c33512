"""Where compiled kernels are kept.

numba judges its cache by the file of the outermost kernel alone: after an update of a file which that kernel calls
into, it would go on running the old code. So the cache's folder is named after all the sources.
"""

import hashlib
import logging
import os
import tempfile
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
_PACKAGES = ("estimation", "ingest/kernels", "answers/kernels")

_log = logging.getLogger(__name__)


def sources_digest() -> str:
    """Of all that the kernels, and the meaning of their rows, are made of."""
    sources = sorted(source for name in _PACKAGES for source in (Path(__file__).parents[1] / name).rglob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]


def use_kernel_cache() -> None:
    """Choose the cache's folder, unless the environment has. It takes effect if numba is not imported yet."""
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
        # Only a folder that nobody else can have filled: what is read from a cache is run.
        folder = Path(tempfile.mkdtemp(prefix="dropanchor-kernels-"))
        _log.warning("%s is not writable: the estimator is compiled at every start; set %s", home, VARIABLE)
    os.environ[VARIABLE] = str(folder)
