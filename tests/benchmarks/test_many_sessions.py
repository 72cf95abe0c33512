"""Measure how long a thousand tags with a session each take to reconnect to a restarted router."""

import time

import pytest

from benchmarks import proc, report
from benchmarks.programs import running
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, wait_until

SESSIONS = 1000
ONLINE, MESSAGES = "dropanchor_tags_online", "dropanchor_messages_total"

pytestmark = pytest.mark.benchmark


def test_all_sessions_are_back_after_the_router_restarts() -> None:
    endpoint = free_endpoint()
    with running_service("--engine", "fleet", endpoint=endpoint) as service:
        before = proc.resident_bytes(service.process.pid)
        with running("tagged_sessions", endpoint, SESSIONS) as tags:
            wait_until(lambda: service.metric(ONLINE) == SESSIONS, 60.0)
            wait_until(lambda: service.metric(MESSAGES) >= 2 * SESSIONS, 60.0)
            resident = (proc.resident_bytes(service.process.pid) - before) / SESSIONS
            service.process.kill()
            service.process.wait()
            with running_service("--engine", "fleet", endpoint=endpoint) as again:
                back_s = _back_after(again)
            tags.send_line("end")
    report.record(
        "sessions",
        f"{SESSIONS} sessions to the service's own router: {resident / 1e3:.0f} kB each in the service. After "
        f"`kill -9` and a new start all tokens are back {back_s[0]:.1f} s after the service is ready, and all tags "
        f"have sent a message after {back_s[1]:.1f} s.",
    )


def _back_after(service: Running) -> tuple[float, float]:
    """Return the seconds from a ready service until all tokens exist, and until every tag has sent a message."""
    began_s = time.monotonic()
    wait_until(lambda: service.metric(ONLINE) == SESSIONS, 60.0)
    online_s = time.monotonic() - began_s
    wait_until(lambda: sum(tag["messages"] > 0 for tag in service.get("/api/v1/tags")["tags"]) == SESSIONS, 60.0)
    return online_s, time.monotonic() - began_s
