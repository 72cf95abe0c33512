"""`dropanchor doctor` finds what is wrong with a tag, now and at a time that is past, and its exit code says so."""

import time
from pathlib import Path

from dropanchor_schemas.wire import ENCODING_JSON
from dropanchor_service.runtime.written_by import FILE
from support.commands import Ended
from support.service import ended
from support.yard import running_yard
from support.zenoh_router import free_port, wait_until

TAG = "forklift-7"


def doctor(url: str, *options: str) -> Ended:
    return ended("doctor", "--url", url, *options)


def test_a_rejection_a_change_of_settings_and_silence_are_found_with_their_times(tmp_path: Path) -> None:
    with running_yard(tmp_path, TAG) as yard:
        assert doctor(yard.url) == Ended(0, "good  service: it is ready\n", "")
        junk = b'{"range": [{"t_ns": %d, "anchor": 7, "range_m": -1.0}]}' % time.time_ns()
        yard.ask("POST", f"/api/v1/ingest/samples?tag={TAG}", content=junk, headers={"content-type": ENCODING_JSON})
        wait_until(lambda: "range_negative" in yard.get(f"/api/v1/tags/{TAG}")["rejected"])
        yard.put(f"/api/v1/tags/{TAG}/settings", {"mount_angle_rad": 1.5})
        found = doctor(yard.url, "--tag", TAG)
        assert found.returncode == 1, found.stderr
        lines = found.stdout.splitlines()
        for begin, end in (
            ("LOOK  tag, sensors: 1 x range_negative at 20", "below zero"),
            ("LOOK  settings: 20", "mount_angle_rad None → 1.5"),
            ("good  service: its clock is ", " s from that of this machine"),
        ):
            assert [line for line in lines if line.startswith(begin) and end in line], found.stdout
        found = doctor(yard.url, "--data-dir", str(tmp_path))
        assert found.returncode == 0, found.stdout
        looked = ("versions", "kernels", "folder", "service")
        assert [line.split(":")[0] for line in found.stdout.splitlines()] == [f"good  {where}" for where in looked]
        assert doctor(yard.url, "--tag", "nobody").returncode == 2
        assert "black box holds nothing" in doctor(yard.url, "--tag", TAG, "--at", "2020-01-01T00:00:00Z").stderr
    (tmp_path / FILE).write_text("999.0.0")
    nowhere, empty = f"http://127.0.0.1:{free_port()}", tmp_path / "kernels"
    found = ended("doctor", "--url", nowhere, "--data-dir", str(tmp_path), NUMBA_CACHE_DIR=str(empty))
    assert found.returncode == 2
    assert "LOOK  folder: version 999.0.0 wrote" in found.stdout
    assert f"LOOK  kernels: {empty} has not all of this version" in found.stdout
