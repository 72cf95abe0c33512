"""A service that is killed while people change settings: what it acknowledged holds, and the trail names it."""

import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event
from typing import Any

import httpx
import pytest

from support.events import circle
from support.service import Running, running_service

KILLED_AFTER = 15  # acknowledged changes
CHANGES: dict[str, tuple[str, Any]] = {
    "tag": ("tags/cart/settings", lambda number: {"height_m": number / 10}),
    "anchor": ("anchors/7", lambda number: {"id": "7", "x": float(number)}),
    "zone": ("zones/dock", lambda number: circle(radius_m=float(number)).model_dump()),
}


def put_until_killed(service: Running, kind: str, acknowledged: list[int], enough: Event) -> None:
    """Put one change after the other until nobody answers."""
    path, body = CHANGES[kind]
    with httpx.Client(base_url=service.url, trust_env=False, verify=False) as client:
        for number in range(1, 10_000):
            try:
                client.put(f"/api/v1/{path}", json=body(number)).raise_for_status()
            except httpx.TransportError:
                return
            acknowledged.append(number)
            if number == KILLED_AFTER:
                enough.set()


@pytest.mark.parametrize("kind", CHANGES)
def test_what_was_acknowledged_before_a_kill_holds_and_is_in_the_trail(tmp_path: Path, kind: str) -> None:
    words = ("--engine", "paper", "--data-dir", str(tmp_path))
    path, body = CHANGES[kind]
    acknowledged: list[int] = []
    enough = Event()
    with running_service(*words) as service, ThreadPoolExecutor(1) as pool:
        changing = pool.submit(put_until_killed, service, kind, acknowledged, enough)
        while not enough.wait(0.1):
            assert not changing.done(), changing.exception()
        service.stop(signal.SIGKILL)
        changing.result()
    with running_service(*words) as service:
        entries = service.get(f"/api/v1/audit?kind={kind}&limit=1000")["entries"]
        now = service.get(f"/api/v1/{path}")
    expected = [body(number) for number in acknowledged]
    for entry, wanted in zip(reversed(entries), expected, strict=False):
        assert entry["confirmed"]
        assert entry["by"] == {"source": "local", "name": ""}
        assert wanted.items() <= entry["after"].items()
    assert len(expected) <= len(entries) <= len(expected) + 1  # the last change may have been made, without an answer
    assert now in [entries[0]["after"], entries[0]["before"]]
    assert expected[-1].items() <= now.items() or len(entries) == len(expected) + 1
