"""A real service that is killed, and started again on a host whose clock is wrong, goes on with its tags' time."""

import signal
import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from support.live_tags import LiveTags
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

HOUR_S = 3600.0
LIVES_S = (0.0, 24 * HOUR_S, -3 * HOUR_S, 0.0)
TAGS, SEED = 3, 1
NEAR_S = 60.0
WRITTEN = 'dropanchor_checkpoints_total{outcome="written"}'


def is_named(service: Running, wanted: bool) -> bool:
    """Return whether readiness and one line of the log name the clock of the machine exactly if that is `wanted`."""
    impaired = service.get("/api/v1/health/ready")["impaired"]
    return all(sum("clock of this machine" in one for one in said) == wanted for said in (impaired, service.log))


def has_written(service: Running, checkpoints: float) -> bool:
    return service.metric(WRITTEN) >= checkpoints


def live_poses(service: Running) -> list[dict[str, Any]]:
    """Return the poses that are of now, by the clock of the test, which is that of the tags."""
    time.sleep(0.2)  # limits the load of asking
    poses = service.get("/api/v1/poses")["poses"]
    return [pose for pose in poses if abs(pose["t_ns"] * 1e-9 - time.time()) < NEAR_S and abs(pose["age_s"]) < NEAR_S]


def test_poses_keep_the_time_of_the_tags_whatever_the_clock_of_the_host_shows(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with ExitStack() as opened:
        opened.enter_context(router_process(endpoint))
        tags = LiveTags(endpoint, TAGS, SEED, cache_messages=2000)
        options = ("--config", str(tags.write_settings(tmp_path)), "--data-dir", str(tmp_path / "data"))
        for life, ahead_s in enumerate(LIVES_S):
            with running_service(*options, "--zenoh-connect", endpoint, clock_ahead_s=ahead_s) as service:
                if life == 0:
                    opened.enter_context(tags)
                wait_until(lambda: len(live_poses(service)) == TAGS)
                wait_until(partial(is_named, service, ahead_s != 0.0))
                assert abs(service.metric("dropanchor_host_clock_error_seconds") - ahead_s) < NEAR_S
                wait_until(lambda: {pose["state"] for pose in live_poses(service)} == {"tracking"})
                for status in service.get("/api/v1/tags")["tags"]:
                    assert status["clock_error_s"] is None
                    assert status["needs_care"] == []
                written = service.metric(WRITTEN)  # with the time that the tags told
                wait_until(partial(has_written, service, written + 2))
                service.stop(signal.SIGKILL)
