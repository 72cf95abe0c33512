"""A service that is killed again and again while its tags publish loses nothing, and ends where an uninterrupted one
would.

DROPANCHOR_KILLS, _KILLED_TAGS and _KILLED_STEP_S (from one message of a tag to the next) make more of it,
DROPANCHOR_KILL_SEED another one.
"""

import logging
import os
import random
import signal
import statistics
import time
from collections import Counter
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from support.live_tags import LiveTags, distance, is_current, samples_of
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

KILLS = int(os.environ.get("DROPANCHOR_KILLS", "2"))
TAGS = int(os.environ.get("DROPANCHOR_KILLED_TAGS", "3"))
SEED = int(os.environ.get("DROPANCHOR_KILL_SEED", "1"))
DOWN_S = 2.0
UP_S = 3.0  # at most, from being current to the next kill
STEP_S = float(os.environ.get("DROPANCHOR_KILLED_STEP_S", "0.1"))
LATE_NS = 250_000_000  # of times on a boot clock, at most: the service cannot know the delay of a message

_log = logging.getLogger(__name__)


@pytest.mark.parametrize(
    ("router", "clock"), [("outside", "utc"), ("inside", "utc"), ("outside", "boot"), ("inside", "boot")]
)
def test_a_service_that_is_killed_loses_nothing_and_ends_where_an_uninterrupted_one_would(
    tmp_path: Path, router: str, clock: str
) -> None:
    endpoint, took_s = free_endpoint(), []
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
                took_s.append(until_current(service))
                time.sleep(dice.uniform(0.0, UP_S))
                assert lost(service) == {}, f"in life {life}"
                service.stop(signal.SIGKILL)
            time.sleep(DOWN_S)
        with running_service(*options) as service:
            took_s.append(until_current(service))
            tags.finish()
            with suppress(AssertionError):  # the next line says which are missing
                wait_until(lambda: samples_of(service) == tags.samples)
            assert lost(service) == {}
            assert samples_of(service) == tags.samples
            answers = {pose["tag"]: pose for pose in service.get("/api/v1/poses")["poses"]}
    expected = tags.expected(config)
    assert expected.keys() == answers.keys()
    apart = {tag: distance(pose, answers[tag]) for tag, pose in expected.items()}
    _log.info("samples %s, apart %.2g m at most", sum(map(Counter.total, tags.samples.values())), max(apart.values()))
    _log.info("current %.2f s after the start, %.2f s at most", statistics.median(took_s[1:]), max(took_s[1:]))
    late_ns = [answers[tag]["t_ns"] - int(pose["t_ns"]) for tag, pose in expected.items()]
    _log.info("late %.3g to %.3g ms", min(late_ns) * 1e-6, max(late_ns) * 1e-6)
    assert 0 <= min(late_ns) <= max(late_ns) <= (LATE_NS if clock == "boot" else 0)
    assert max(apart.values()) < 1e-3


def lost(service: Running) -> dict[str, float]:
    """What this process has counted that is not zero. What came twice, recovered by Zenoh and told by a cache, is no
    loss; that it was used once the samples tell."""
    by_reason = (f'dropanchor_rejected_total{{reason="{reason}"}}' for reason in ("late", "shed"))
    names = (*by_reason, "dropanchor_given_up_messages_total", "dropanchor_missed_messages_total")
    counted = {name: service.metric(name) for name in names}
    return {name: value for name, value in counted.items() if value}


def until_current(service: Running) -> float:
    """s, from the start of its process."""
    wait_until(lambda: is_current(service, TAGS), 60.0)
    return time.monotonic() - service.began_s
