"""A compile cache that knows all sources.

numba looks only at the file of the outermost kernel: after a change in a file that kernel calls into, it would go on
running the old code. So the cache's place is named after the sources. Takes effect before numba is imported.
"""

import fcntl
import functools
import hashlib
import os
import subprocess
import sys
from pathlib import Path

from support.commands import environment

ROOT = Path(__file__).parents[2]


def use_cache_of_these_sources() -> None:
    """Set NUMBA_CACHE_DIR, for this process and its children, unless somebody has."""
    package = ROOT / "service" / "dropanchor_service"
    sources = [
        source
        for name in ("estimation/fleet", "ingest/kernels", "answers/kernels")
        for source in sorted((package / name).rglob("*.py"))
    ]
    digest = hashlib.sha256(
        b"".join(source.read_bytes() for source in [*sources, *sorted(ROOT.glob("tests/support/*.py"))])
    )
    os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / ".numba_cache" / digest.hexdigest()[:16]))


@functools.cache
def compile_once() -> None:
    """Fill the cache, for services that are started with a limit on the time they may take. Of several processes one
    does it, and the others wait."""
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        subprocess.run([sys.executable, "-m", "dropanchor_service", "compile"], env=environment(), check=True)
