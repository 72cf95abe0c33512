"""Somebody corrects the place of the only anchor of a running service: its tags go on, also over a restart."""

import signal
import time
from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from dropanchor_schemas.wire import ENCODING_PACKED, Frame, encode_packed
from dropanchor_tag_client.simulator.live import Delivery, deliveries
from dropanchor_tag_client.simulator.sensors import preset
from support.service import Running, running_service
from support.zenoh_router import wait_until

SEED = 48_811
WAY_M = 100.0  # further than the tag drives meanwhile
FOUND_AGAIN_NS = 15 * 10**9  # sooner than a tag that starts afresh is found
BEGAN_S = 60.0  # ago: long enough for this tag to be found


class Sender:
    """Sends a simulated drive that began a while ago."""

    def __init__(self) -> None:
        self._t0_ns = time.time_ns() - int(BEGAN_S * 1e9)
        models = preset("calibrated", range_hz=10.0, imu_hz=50.0)
        self._parts: Iterator[Delivery] = deliveries(1, "yard", SEED, models, self._t0_ns)

    def send(self, service: Running) -> None:
        """Send what the tag has measured until now."""
        until_s = (time.time_ns() - self._t0_ns) * 1e-9
        parts = list(takewhile(lambda part: part.due_s < until_s, self._parts))
        for batch in batched(parts, 100):
            frame = Frame([one for part in batch for one in part.imu], [one for part in batch for one in part.ranges])
            headers = {"content-type": ENCODING_PACKED}
            body = encode_packed(frame)
            service.ask("POST", "/api/v1/ingest/samples?tag=cart", content=body, headers=headers).raise_for_status()

    def until_tracking(self, service: Running) -> dict[str, Any]:
        """Send until a new pose is tracked, and return it."""
        found: list[dict[str, Any]] = []
        since_ns = time.time_ns()

        def is_tracked() -> bool:
            self.send(service)
            found.append(service.ask("GET", "/api/v1/tags/cart/pose").json())
            return bool(found[-1].get("t_ns", 0) > since_ns and found[-1]["state"] == "tracking")

        wait_until(is_tracked)
        return found[-1]


def batched(parts: Sequence[Delivery], size: int) -> Iterator[Sequence[Delivery]]:
    return (parts[first : first + size] for first in range(0, len(parts), size))


def test_the_tags_of_a_corrected_anchor_shift_with_it_and_back_also_over_a_restart(tmp_path: Path) -> None:
    sender, options = Sender(), ("--data-dir", str(tmp_path))
    with running_service(*options) as service:
        before = sender.until_tracking(service)
        service.put("/api/v1/anchors/1", {"id": "1", "x": 300.0})
        shifted = sender.until_tracking(service)
        assert abs(shifted["x"] - before["x"] - 300.0) < WAY_M
        assert shifted["t_ns"] - before["t_ns"] < FOUND_AGAIN_NS
        service.stop(signal.SIGTERM)
    with running_service(*options) as service:
        service.put("/api/v1/anchors/1", {"id": "1", "x": 0.0})
        back = sender.until_tracking(service)
    assert abs(back["x"] - before["x"]) < WAY_M
