"""A killed service continues from its last checkpoint."""

import signal
import time
from pathlib import Path

import numpy as np

from dropanchor_service.checkpoints.format import sealed, unsealed
from dropanchor_tag_client import TagClient
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import wait_until


def send(service: Running, tag: str, count: int, t_ns: int | None = None) -> None:
    """Publish samples of a tag, and wait until the service has used them."""
    frame = straight_north(count, t_ns)
    with TagClient(tag, connect=service.zenoh) as client:
        for imu, heading, distance in zip(frame.imu, frame.headings, frame.ranges, strict=True):
            client.publish_imu(imu.acc, imu.gyro, imu.mag, t_ns=imu.t_ns)
            client.publish_heading(heading.heading_rad, t_ns=heading.t_ns, std_rad=heading.std_rad)
            client.publish_range("7", distance.range_m, t_ns=distance.t_ns, std_m=distance.std_m)
        client.flush()
        wait_until(lambda: service.get(f"/api/v1/tags/{tag}")["samples"].get("range", 0) >= count)


def wait_for_checkpoint(service: Running) -> None:
    """Wait until a checkpoint holds all samples that have arrived so far."""
    now_s = time.monotonic()
    wait_until(lambda: time.monotonic() - service.metric("dropanchor_checkpoint_age_seconds") > now_s + 0.1)


def test_a_killed_service_restores_its_poses_and_none_of_them_is_tracking(tmp_path: Path) -> None:
    config = settings_file(tmp_path, ["a"], 'engine = "fleet"')
    options = ("--config", str(config), "--data-dir", str(tmp_path / "data"))
    with running_service(*options) as service:
        send(service, "a", 50)
        wait_for_checkpoint(service)
        before = service.get("/api/v1/tags/a/pose")
        assert before["x"] is not None
        service.stop(signal.SIGKILL)
    with running_service(*options) as service:
        after = service.get("/api/v1/tags/a/pose")
        status = service.get("/api/v1/tags/a")
        assert any("going on from a checkpoint with 1 tags" in line for line in service.log)
    for name in ("t_ns", "x", "y", "heading_rad", "covariance"):
        assert after[name] == before[name]
    assert after["state"] != "tracking"
    assert after["age_s"] > before["age_s"]
    assert status["samples"] == {"imu": 50, "heading": 50, "range": 50}


def test_a_checkpoint_of_another_layout_is_refused_by_name_and_all_tags_start_afresh(tmp_path: Path) -> None:
    config = settings_file(tmp_path, ["a"], 'engine = "fleet"')
    options = ("--config", str(config), "--data-dir", str(tmp_path))
    with running_service(*options) as service:
        send(service, "a", 20)
        assert service.stop() == 0
    newest = max(path for path in (tmp_path / "checkpoints").iterdir() if "-since-" not in path.name)
    newest_bytes = with_another_layout(newest.read_bytes())
    newest.write_bytes(newest_bytes)
    for other in (tmp_path / "checkpoints").iterdir():
        if other != newest:
            other.unlink()
    with running_service(*options) as service:
        log = "".join(service.log)
        assert f"{newest.name} is not used: its layout is " in log
        assert "all tags start afresh" in log
        assert (newest.parent / f"unread-{newest.name}").read_bytes() == newest_bytes
        assert service.get("/api/v1/poses")["poses"] == []


def with_another_layout(checkpoint: bytes) -> bytes:
    """Return the checkpoint as another version could have written it: complete, but with another name of its layout."""
    header, content = unsealed(checkpoint)
    return b"".join(sealed(header | {"layout": f"0{header['layout']}"}, [np.frombuffer(content, np.uint8)]))
