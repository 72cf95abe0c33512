"""The version that is installed is read from the disk, also while another one runs."""

import sys
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import pytest

from dropanchor_service.cluster.versions import installed


def install(folder: Path, name: str, number: str) -> None:
    for former in folder.glob(f"{name}-*"):
        former.rename(folder / f"~{former.name}")
    made = folder / f"{name}-{number}.dist-info"
    made.mkdir()
    (made / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {number}\n\nVersion: of what?\n")


def test_an_update_is_seen_and_a_new_ray_under_a_running_one_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "ray", raising=False)
    assert installed() == version("dropanchor-service")
    monkeypatch.syspath_prepend(tmp_path)
    for number in ("8.1.0", "8.2.0"):
        install(tmp_path, "dropanchor_service", number)
        assert installed() == number
    monkeypatch.setitem(sys.modules, "ray", SimpleNamespace(__version__="2.0.0"))
    install(tmp_path, "ray", "2.1.0")
    assert installed() == "8.2.0 with Ray 2.1.0 under the running 2.0.0"
