"""A client starts no threads of Zenoh: the process would abort if it ended before one of them."""

import threading
from pathlib import Path

import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_tag_client import TagClient, Upkeep
from support.listening import listening_with_recovery
from support.zenoh_router import connected_session, wait_until

SETTINGS = keys.settings_key("default", "a")


def answer(query: zenoh.Query) -> None:
    with query:
        query.reply(SETTINGS, b'{"batch_s": 0.5}')


def test_a_client_with_upkeep_and_a_spool_starts_only_its_own_threads(
    router_endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[str] = []
    start = threading.Thread.start

    def record(thread: threading.Thread) -> None:
        started.append(thread.name)
        start(thread)

    with (
        listening_with_recovery(router_endpoint) as heard,
        connected_session(router_endpoint) as session,
        session.declare_queryable(SETTINGS, answer),
    ):
        monkeypatch.setattr(threading.Thread, "start", record)
        with TagClient("a", connect=router_endpoint, spool=tmp_path) as tag, Upkeep([tag], period_s=0.05):
            tag.publish_range(1, 1.0)
            tag.flush()
            wait_until(lambda: heard.frames and tag.wanted is not None)
        monkeypatch.undo()
    key = keys.samples_key("default", "a")
    assert sorted(started) == [f"connect {key}", "flush a", f"spool {key}", "upkeep"]
