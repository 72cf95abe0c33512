"""A full disk stops neither the poses nor the service, and the service reports it."""

import resource
import signal
from contextlib import ExitStack
from pathlib import Path

from support.live_tags import LiveTags, is_current, samples_of
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

TAGS, SEED = 2, 5


def impaired(service: Running) -> str:
    """Return what a service that is ready reports as impaired."""
    answer = service.ask("GET", "/api/v1/health/ready")
    assert answer.status_code == 200
    return "; ".join(answer.json()["impaired"])


def set_file_limit(service: Running, size: int) -> None:
    """Make writes beyond `size` bytes of a file fail, as on a full disk (EFBIG, see setrlimit(2))."""
    pid = service.process.pid
    _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, hard))


def test_on_a_full_disk_poses_continue_and_the_last_complete_checkpoint_is_used(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    tags = LiveTags(endpoint, TAGS, SEED, cache_messages=6000)
    config = tags.write_settings(tmp_path)
    options = ("--config", str(config), "--data-dir", str(tmp_path / "data"), "--zenoh-connect", endpoint)
    failed, written = (f'dropanchor_checkpoints_total{{outcome="{outcome}"}}' for outcome in ("failed", "written"))
    with router_process(endpoint), ExitStack() as opened:
        with running_service(*options) as service:
            opened.enter_context(tags)  # it asks the caches of tags that it does not know for their last 100 messages
            wait_until(lambda: is_current(service, TAGS) and service.metric(written) > 0)
            assert "checkpoint" not in impaired(service)
            set_file_limit(service, 0)
            wait_until(lambda: "the newest checkpoint is" in impaired(service))
            assert service.metric(failed) > 0
            assert service.metric("dropanchor_checkpoint_age_seconds") > 1.0
            wait_until(lambda: is_current(service, TAGS))
            set_file_limit(service, resource.RLIM_INFINITY)
            wait_until(lambda: impaired(service) == "")
            set_file_limit(service, 0)
            before = service.metric(failed)
            wait_until(lambda: service.metric(failed) > before)
            service.stop(signal.SIGKILL)
        with running_service(*options) as service:
            assert any("going on from a checkpoint" in line for line in service.log)
            wait_until(lambda: is_current(service, TAGS))
            tags.finish()
            wait_until(lambda: samples_of(service) == tags.samples)
