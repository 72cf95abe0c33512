"""The history of a real service survives a restart and a disk that is full for a while."""

import resource
import time
from pathlib import Path

import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.track import Track
from dropanchor_schemas.wire import ENCODING_PACKED, encode_packed
from dropanchor_service.recording.reading import RecordingReader
from support.patience import PATIENCE_S
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import connected_session, wait_until

S = 1_000_000_000


def drive(session: zenoh.Session, end_ns: int) -> None:
    """Publish 10 s of samples up to `end_ns`."""
    frame = straight_north(100, end_ns)
    session.put(keys.samples_key("default", "a"), encode_packed(frame), encoding=ENCODING_PACKED)


def track(service: Running, end_ns: int) -> Track:
    return Track.model_validate(service.get(f"/api/v1/tags/a/track?from={end_ns - 12 * S}&to={end_ns}"))


def test_a_track_and_the_pose_at_a_time_survive_a_restart(tmp_path: Path) -> None:
    end_ns = time.time_ns()
    options = ["--data-dir", str(tmp_path), "--engine", "paper"]  # writes no checkpoint, so no tag is known afterwards
    configured = ["--config", str(settings_file(tmp_path, ["a"])), *options]
    with running_service(*configured) as service, connected_session(service.zenoh) as session:
        drive(session, end_ns)
        wait_until(lambda: service.metric("dropanchor_poses_total") >= 90)
        assert service.stop() == 0
    with running_service(*options) as service, connected_session(service.zenoh) as session:
        assert service.get("/api/v1/tags")["tags"] == []
        poses = track(service, end_ns).poses
        assert len(poses) >= 8
        middle = poses[3].t_ns
        assert service.get(f"/api/v1/tags/a/pose?at={middle}")["state"] == poses[3].state
        replies = [
            reply.ok for reply in session.get(f"{keys.pose_key('default', 'a')}?at={middle}", timeout=PATIENCE_S)
        ]
        assert replies[0] is not None
        assert str(middle) in replies[0].payload.to_string()


def test_on_a_full_disk_the_service_reports_it_and_writes_again_once_there_is_space(tmp_path: Path) -> None:
    config = settings_file(tmp_path, ["a"], "[recording]\nenabled = true")
    options = ["--config", str(config), "--data-dir", str(tmp_path)]
    with running_service(*options) as service, connected_session(service.zenoh) as session:
        wait_until(lambda: service.metric("dropanchor_history_bytes") > 0)
        limit_file_size(service, 4096)
        full_ns = time.time_ns()
        drive(session, full_ns)
        failing = [f"dropanchor_{what}_failing" for what in ("history", "recording")]
        wait_until(lambda: all(service.metric(name) == 1 for name in failing))
        for what in ("history", "recording"):
            assert any(what in problem for problem in service.get("/api/v1/health/ready")["impaired"])
            assert service.metric(f"dropanchor_{what}_errors_total") >= 1
        assert service.get("/api/v1/tags/a/pose")["t_ns"] > full_ns - S
        limit_file_size(service, resource.RLIM_INFINITY)
        wait_until(lambda: service.get("/api/v1/health/ready")["impaired"] == [])
        assert len(track(service, full_ns).poses) >= 5  # fewer where the tag is detected as standing still
        for what in ("history", "recording"):
            assert service.metric(f"dropanchor_{what}_dropped_total") == 0
        assert service.stop() == 0
    (recorded,) = (tmp_path / "recordings").glob("*.mcap")
    payloads = [message[1] for turn in RecordingReader(recorded).turns() for message in turn.messages]
    assert payloads == [encode_packed(straight_north(100, full_ns))]


def limit_file_size(service: Running, max_bytes: int) -> None:
    """Make writes of the service beyond `max_bytes` of a file fail, as on a full disk."""
    resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, (max_bytes, resource.RLIM_INFINITY))
