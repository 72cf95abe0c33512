"""Build `dropanchor-kernels`: the estimator, compiled for the family of this machine's processor and for its Python.

With it the first start of the service compiles nothing. It stands beside the release: the same sources give the same
results, but not the same bytes, since a compiler names things anew each time.
"""

import os
import subprocess
import sys
from importlib.metadata import version as version_of
from pathlib import Path
from tempfile import TemporaryDirectory

from dropanchor_service.runtime import kernel_cache
from dropanchor_service.runtime.shipped_kernels import PACKAGE, collect, family, made_for
from release.hatch import hatch
from release.staging import FOLDERS, last_commit_s, stage
from release.version import ROOT, version

PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "dropanchor-kernels"
version = "{version}"
description = "The estimator of Dropanchor, compiled for {processor}"
requires-python = "=={python}.*"
license = "Apache-2.0"
license-files = ["LICENSE"]
dependencies = ["dropanchor-service=={version}", "numba=={numba}"]

[tool.hatch.build.targets.wheel]
packages = ["dropanchor_kernels"]
ignore-vcs = true

[tool.hatch.build.hooks.custom]
"""
HOOK = """from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Tag(BuildHookInterface):
    def initialize(self, version, build_data):
        build_data["pure_python"], build_data["tag"] = False, "{tag}"
"""
DOC = (
    '"""Compiled kernels. `dropanchor_service.runtime.shipped_kernels` copies them to where numba looks for them."""\n'
)


def compile_kernels(sources: Path, into: Path) -> None:
    """Compile all kernels of a folder with the staged distributions, whose place the compiled code names."""
    for folder in FOLDERS:
        stage(folder, sources / folder)
    paths = os.pathsep.join(str(sources / folder) for folder in FOLDERS)
    environment = os.environ | {kernel_cache.VARIABLE: str(into), "PYTHONPATH": paths}
    subprocess.run([sys.executable, "-m", "dropanchor_service", "compile"], check=True, env=environment, cwd=sources)


def build_kernels(into: Path) -> Path | None:
    """Build the wheel into a folder. Return it, or None where the processor belongs to no family that is known."""
    processor = family()
    if processor is None:
        return None
    python, numba = f"{sys.version_info[0]}.{sys.version_info[1]}", version_of("numba")
    tag = f"cp{python.replace('.', '')}-none-linux_x86_64"
    with TemporaryDirectory() as place:
        sources, cache, staged = (Path(place) / name for name in ("sources", "cache", "staged"))
        compile_kernels(sources, cache)
        package = sources / "service" / "dropanchor_service"
        staged.mkdir()
        collect(cache, staged / PACKAGE, made_for(kernel_cache.sources_digest(), processor), package)
        (staged / PACKAGE / "__init__.py").write_text(DOC)
        values = {"version": version(), "processor": processor, "python": python, "numba": numba}
        (staged / "pyproject.toml").write_text(PROJECT.format(**values))
        (staged / "hatch_build.py").write_text(HOOK.format(tag=tag))
        (staged / "LICENSE").write_bytes((ROOT / "LICENSE").read_bytes())
        hatch("wheel", staged, into, last_commit_s())
    return into / f"{PACKAGE}-{version()}-{tag}.whl"
