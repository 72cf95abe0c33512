"""A service that is killed while people change settings: what it acknowledged holds, and the trail names it."""

import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx

from support.events import circle
from support.service import Running, running_service
from support.zenoh_router import wait_until

KILLED_AFTER = 15  # acknowledged changes
CHANGES: dict[str, tuple[str, Any]] = {
    "tag": ("tags/cart/settings", lambda number: {"height_m": number / 10}),
    "anchor": ("anchors/7", lambda number: {"id": "7", "x": float(number)}),
    "zone": ("zones/dock", lambda number: circle(radius_m=float(number)).model_dump()),
}


def put_until_killed(service: Running, kind: str, acknowledged: list[int]) -> None:
    """Put one change after the other until nobody answers."""
    path, body = CHANGES[kind]
    with httpx.Client(base_url=service.url, trust_env=False, verify=False) as client:
        for number in range(1, 10_000):
            try:
                client.put(f"/api/v1/{path}", json=body(number)).raise_for_status()
            except httpx.TransportError:
                return
            acknowledged.append(number)


def test_what_was_acknowledged_before_a_kill_holds_and_is_in_the_trail(tmp_path: Path) -> None:
    """People change all kinds at once."""
    words = ("--engine", "paper", "--data-dir", str(tmp_path))
    acknowledged: dict[str, list[int]] = {kind: [] for kind in CHANGES}
    with running_service(*words) as service, ThreadPoolExecutor(len(CHANGES)) as pool:
        changing = [pool.submit(put_until_killed, service, kind, acknowledged[kind]) for kind in CHANGES]
        wait_until(lambda: all(len(numbers) >= KILLED_AFTER for numbers in acknowledged.values()))
        service.stop(signal.SIGKILL)
        for one in changing:
            one.result()
    with running_service(*words) as service:
        for kind, (path, body) in CHANGES.items():
            entries = service.get(f"/api/v1/audit?kind={kind}&limit=1000")["entries"]
            now = service.get(f"/api/v1/{path}")
            expected = [body(number) for number in acknowledged[kind]]
            for entry, wanted in zip(reversed(entries), expected, strict=False):
                assert entry["confirmed"]
                assert entry["by"] == {"source": "local", "name": ""}
                assert wanted.items() <= entry["after"].items()
            # The last change may have been made, without an answer.
            assert len(expected) <= len(entries) <= len(expected) + 1
            assert now in [entries[0]["after"], entries[0]["before"]]
            assert expected[-1].items() <= now.items() or len(entries) == len(expected) + 1
