"""A router that is killed repeatedly while tags publish costs no sample, and everything reconnects by itself."""

import logging
import time
from functools import partial
from pathlib import Path

from support.live_tags import LiveTags, distance, fused, is_current, poses_of, samples_of
from support.service import running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

TAGS, KILLS, SEED = 3, 3, 4
DOWN_S = 1.5

_log = logging.getLogger(__name__)


def test_a_killed_router_costs_no_sample_and_the_poses_become_current_again(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    tags = LiveTags(endpoint, TAGS, SEED, cache_messages=6000)
    config = tags.write_settings(tmp_path)
    with running_service("--config", str(config), "--zenoh-connect", endpoint, ready=False) as service:
        for life in range(KILLS + 1):
            with router_process(endpoint):
                back_s = time.monotonic()
                if life == 0:
                    tags.start()
                wait_until(lambda: is_current(service, TAGS))
                _log.info("All poses were current %.2f s after the router started.", time.monotonic() - back_s)
                if life == KILLS:
                    tags.finish()
                    wait_until(lambda: samples_of(service) == tags.samples)
                    expected = tags.expected(config)
                    answers = fused(expected, partial(poses_of, service))
                    assert service.metric("dropanchor_missed_messages_total") == 0
                    tags.close()
            time.sleep(DOWN_S)
    apart = {tag: distance(pose, answers[tag]) for tag, pose in expected.items()}
    assert apart.keys() == answers.keys()
    assert max(apart.values()) < 1e-3
