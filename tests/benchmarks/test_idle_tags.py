"""Many tags of which few move."""

import json
import time

import pytest

from benchmarks import report
from benchmarks.programs import generator, router
from benchmarks.service import counters, lost
from benchmarks.step import when_quiet
from support.service import running_service
from support.zenoh_router import free_endpoint

TAGS, MOVING_S = 100_000, 6.0

pytestmark = pytest.mark.benchmark


def test_a_hundred_thousand_tags_of_which_one_in_a_hundred_moves(tmp_path_factory: pytest.TempPathFactory) -> None:
    endpoint = free_endpoint()
    file = tmp_path_factory.mktemp("idle") / "idle.toml"
    file.write_text(f'max_tags = {2 * TAGS}\n[[site.anchors]]\nid = "0"\n')
    arguments = ("--config", str(file), "--engine", "fleet", "--zenoh-connect", endpoint)
    with router(endpoint), running_service(*arguments) as service:
        empty = counters(service)
        fleet = generator(endpoint, TAGS // 100, MOVING_S, register=TAGS)
        try:
            registered = when_quiet(lambda: counters(service), 600.0, quiet_s=3.0)
            fleet.tell(time.time_ns() + 300_000_000)
            moved = json.loads(fleet.ask("end"))
            after = when_quiet(lambda: counters(service))
        finally:
            fleet.end()
        heard = int(service.metric("dropanchor_tags_registered"))
        waiting = int(service.metric("dropanchor_newcomers"))
    per_tag = (registered.resident_bytes - empty.resident_bytes) / TAGS
    cpu = (after.cpu_s - registered.cpu_s) / MOVING_S
    report.record(
        "idle",
        f"{TAGS:,} tags heard twice: {heard:,} have a row, {per_tag / 1e3:.1f} kB each; of the others {waiting} wait "
        f"for another message, and {after.shed:.0f} messages were shed. While {TAGS // 100:,} of them move: {cpu:.2f} "
        f"CPU-seconds per second, {lost(moved['messages'], registered, after)} samples lost.",
    )
    assert heard >= 0.99 * TAGS
    assert TAGS - heard <= waiting + after.shed
