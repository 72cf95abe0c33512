"""A service whose compiled estimator is damaged, as after a power cut, compiles what is missing and serves."""

import os
import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest

from dropanchor_service.runtime.kernel_cache import VARIABLE, mark_of
from dropanchor_service.runtime.kernel_files import damaged_in
from service.data_folder import full_disk
from support.kernel_cache import compile_once
from support.service import running_service


@pytest.mark.parametrize("has_room", [True, False])
def test_a_service_starts_with_a_damaged_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_room: bool) -> None:
    compile_once()
    cache = tmp_path / "cache"
    shutil.copytree(os.environ[VARIABLE], cache)
    monkeypatch.setenv(VARIABLE, str(cache))
    index, code = next(cache.glob("*/ageing.*.nbi")), next(cache.glob("*/heights.*.1.nbc"))
    index.write_bytes(b"")
    whole = bytearray(code.read_bytes())
    whole[len(whole) // 2] ^= 0x80
    code.write_bytes(whole)
    with nullcontext() if has_room else full_disk(), running_service() as service:
        said = "".join(service.log)
    assert f"2 files of the compiled estimator in {cache} are damaged" in said
    assert "Traceback" not in said
    assert ("has no room for the compiled estimator" in said) != has_room
    assert mark_of(cache).exists() == has_room
    assert index.exists() == code.exists() == has_room
    assert damaged_in(cache) == []
