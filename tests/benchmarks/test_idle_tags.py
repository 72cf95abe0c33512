"""Measure the cost of many tags of which few move."""

import json
import time
from contextlib import ExitStack

import pytest

from benchmarks import report
from benchmarks.programs import generator, router
from benchmarks.service import counters, lost, settings_file
from benchmarks.step import when_quiet
from support.service import running_service
from support.zenoh_router import free_endpoint

TAGS, MOVING, MOVING_S = 100_000, 1000, 6.0

pytestmark = pytest.mark.benchmark


def test_the_cost_of_a_hundred_thousand_tags_of_which_one_in_a_hundred_moves(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    endpoint = free_endpoint()
    file = settings_file(MOVING, tmp_path_factory.mktemp("idle"))
    arguments = ("--config", str(file), "--engine", "fleet", "--zenoh-connect", endpoint)
    with ExitStack() as stack:
        stack.enter_context(router(endpoint))
        service = stack.enter_context(running_service(*arguments))
        empty = counters(service)
        stack.callback(generator(endpoint, 0, 0.0, first=MOVING, register=TAGS - MOVING).end)
        registered = when_quiet(lambda: counters(service), 600.0, quiet_s=3.0)
        fleet = generator(endpoint, MOVING, MOVING_S)
        stack.callback(fleet.end)
        fleet.send_line(time.time_ns() + 300_000_000)
        moved = json.loads(fleet.request("end"))
        after = when_quiet(lambda: counters(service))
        registered_tags = int(service.metric("dropanchor_tags_registered"))
        pending = int(service.metric("dropanchor_tags_pending"))
    per_tag = (registered.resident_bytes - empty.resident_bytes) / (TAGS - MOVING)
    cpu = (after.cpu_s - registered.cpu_s) / MOVING_S
    report.record(
        "idle",
        f"{TAGS - MOVING:,} tags sent two messages and {MOVING:,} have settings: {registered_tags:,} have a row of "
        f"{per_tag / 1e3:.1f} kB, {pending} are pending, and {registered.shed:.0f} messages were shed. While "
        f"{MOVING:,} move: {cpu:.2f} CPU-seconds per second, {lost(moved['messages'], registered, after)} samples "
        "lost.",
    )
    assert registered_tags >= 0.99 * TAGS
    assert TAGS - registered_tags <= pending + after.shed
