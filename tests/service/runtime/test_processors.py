"""A process may use as many processors as its affinity and the quotas of its control groups allow."""

import os
from pathlib import Path

import pytest

from dropanchor_service.runtime.processors import usable_processors


def with_quotas(folder: Path, **quotas: str) -> float:
    """Return how many may be used by a process in the group a/b. quotas: of the groups `root`, `a` and `b`."""
    (folder / "own").write_text("0::/a/b\n")
    groups = {"root": folder / "groups", "a": folder / "groups/a", "b": folder / "groups/a/b"}
    groups["b"].mkdir(parents=True)
    for name, quota in quotas.items():
        (groups[name] / "cpu.max").write_text(quota)
    return usable_processors(folder / "groups", folder / "own")


@pytest.mark.parametrize(
    ("quotas", "expected"),
    [
        ({}, 8.0),
        ({"b": "max 100000\n"}, 8.0),
        ({"b": "150000 100000\n"}, 1.5),
        ({"a": "50000 100000\n", "b": "max 100000\n"}, 0.5),
        ({"root": "300000 100000\n", "b": "400000 100000\n"}, 3.0),
        ({"b": "junk"}, 8.0),
    ],
)
def test_the_smallest_quota_counts(
    quotas: dict[str, str], expected: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    assert with_quotas(tmp_path, **quotas) == expected


def test_without_control_groups_the_affinity_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 3}, raising=False)
    assert usable_processors(tmp_path, tmp_path / "none") == 2.0
