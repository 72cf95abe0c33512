"""How many processors this process may use."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_CGROUPS = Path("/sys/fs/cgroup")
_OWN = Path("/proc/self/cgroup")


def usable_processors(cgroups: Path = _CGROUPS, own: Path = _OWN) -> float:
    """Return how many there are by the affinity of this process and by the quota of its control groups (version 2)."""
    affinity = getattr(os, "sched_getaffinity", None)  # Linux has it
    count = os.cpu_count() or 1 if affinity is None else len(affinity(0))
    return min([float(count), *_quotas(cgroups, own)])


def _quotas(cgroups: Path, own: Path) -> Iterator[float]:
    with suppress(OSError):
        path = own.read_text().rpartition("::")[2].strip("/\n")
        for group in (cgroups / path, *(cgroups / path).parents):
            with suppress(OSError, ValueError):
                quota_us, period_us = (group / "cpu.max").read_text().split()
                yield float(quota_us) / float(period_us)  # "max" is no number
