"""A service that is killed repeatedly while tags publish loses no sample and reaches the poses of an uninterrupted one.

DROPANCHOR_KILLS, DROPANCHOR_KILLED_TAGS and DROPANCHOR_KILLED_STEP_S (time between two messages of a tag) scale the
test. DROPANCHOR_KILL_SEED varies it.
"""

import logging
import os
import random
import signal
import statistics
import time
from collections import Counter
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

import pytest

from support.live_tags import LiveTags, distance, fused, is_current, poses_of, samples_of
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

KILLS = int(os.environ.get("DROPANCHOR_KILLS", "2"))
TAGS = int(os.environ.get("DROPANCHOR_KILLED_TAGS", "3"))
SEED = int(os.environ.get("DROPANCHOR_KILL_SEED", "1"))
DOWN_S = 2.0
MAX_UP_S = 3.0  # from current poses to the next kill
STEP_S = float(os.environ.get("DROPANCHOR_KILLED_STEP_S", "0.1"))
MAX_LATE_NS = 250_000_000  # of times from a boot clock: the service cannot know the delay of a message

_log = logging.getLogger(__name__)


@pytest.mark.parametrize(("router", "clock"), [("outside", "utc"), ("inside", "boot")])
def test_a_killed_service_loses_no_sample_and_reaches_the_poses_of_an_uninterrupted_one(
    tmp_path: Path, router: str, clock: str
) -> None:
    endpoint, durations_s = free_endpoint(), []
    with ExitStack() as opened:
        if router == "outside":
            opened.enter_context(router_process(endpoint))
        tags = LiveTags(endpoint, TAGS, SEED, cache_messages=2000, step_s=STEP_S, boot_clock=clock == "boot")
        config = tags.write_settings(tmp_path)
        where = "--zenoh-connect" if router == "outside" else "--zenoh-listen"
        options = ("--config", str(config), "--data-dir", str(tmp_path / "data"), where, endpoint)
        dice = random.Random(SEED)
        for life in range(KILLS):
            with running_service(*options) as service:
                if life == 0:
                    opened.enter_context(tags)
                durations_s.append(wait_until_current(service))
                time.sleep(dice.uniform(0.0, MAX_UP_S))
                assert lost(service) == {}, f"in life {life}"
                service.stop(signal.SIGKILL)
            time.sleep(DOWN_S)
        with running_service(*options) as service:
            durations_s.append(wait_until_current(service))
            tags.finish()
            with suppress(AssertionError):  # the next assertions name what is missing
                wait_until(lambda: samples_of(service) == tags.samples)
            assert lost(service) == {}
            assert samples_of(service) == tags.samples
            expected = tags.expected(config)
            answers = fused(expected, partial(poses_of, service))
    assert expected.keys() == answers.keys()
    apart = {tag: distance(pose, answers[tag]) for tag, pose in expected.items()}
    _log.info(
        "%s samples, poses at most %.2g m apart.", sum(map(Counter.total, tags.samples.values())), max(apart.values())
    )
    _log.info(
        "Poses were current %.2f s after a start (median), %.2f s at most.",
        statistics.median(durations_s[1:]),
        max(durations_s[1:]),
    )
    late_ns = [answers[tag]["t_ns"] - int(pose["t_ns"]) for tag, pose in expected.items()]
    _log.info("Pose times are late by %.3g to %.3g ms.", min(late_ns) * 1e-6, max(late_ns) * 1e-6)
    assert 0 <= min(late_ns) <= max(late_ns) <= (MAX_LATE_NS if clock == "boot" else 0)
    assert max(apart.values()) < 1e-3


def lost(service: Running) -> dict[str, float]:
    """Return the loss counters of this process that are not zero.

    Duplicates, which Zenoh and a cache both deliver, are no loss. The numbers of samples show that each was used once.
    """
    by_reason = (f'dropanchor_rejected_total{{reason="{reason}"}}' for reason in ("late", "shed"))
    names = (*by_reason, "dropanchor_given_up_messages_total", "dropanchor_missed_messages_total")
    counted = {name: service.metric(name) for name in names}
    return {name: value for name, value in counted.items() if value}


def wait_until_current(service: Running) -> float:
    """Wait until the poses are current. Return the time since the start of the process in s."""
    try:
        wait_until(lambda: is_current(service, TAGS))
    except AssertionError:
        pytest.fail(f"not current: {service.get('/api/v1/poses')} {service.get('/api/v1/tags')} {''.join(service.log)}")
    return time.monotonic() - service.began_s
