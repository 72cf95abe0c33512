"""Somebody moves the only anchor of a running service and tells nobody at first, or corrects its place."""

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from dropanchor_schemas.pose import StateReason
from dropanchor_schemas.wire import ENCODING_PACKED, Frame, encode_packed
from dropanchor_tag_client.simulator.live import Delivery, deliveries
from dropanchor_tag_client.simulator.ranging import AnchorPlace
from dropanchor_tag_client.simulator.sensors import preset
from support.service import Running, running_service
from support.zenoh_router import wait_until

SEED = 48_811
FARTHER_X = 8.0  # m, to where somebody moves the anchor
CORRECTED_X = 300.0
WAY_M = 100.0  # further than the tag drives meanwhile
FOUND_AGAIN_NS = 15 * 10**9  # sooner than a tag that starts afresh is found
BEGAN_S = 60.0  # ago: long enough for this tag to be found


Pose = dict[str, Any]


class Sender:
    """Sends simulated drives that began a while ago. anchor_x: where the anchor is in truth; it may change."""

    def __init__(self, tags: int = 1) -> None:
        self._t0_ns = time.time_ns() - int(BEGAN_S * 1e9)
        models = preset("calibrated", range_hz=10.0, imu_hz=50.0)
        self._tags = tags
        self._at = {
            x: deliveries(tags, "yard", SEED, replace(models, anchors=(AnchorPlace(x=x),)), self._t0_ns)
            for x in (0.0, FARTHER_X)
        }
        self.anchor_x = 0.0

    def send(self, service: Running) -> None:
        """Send what the tags have measured until now, five times a second: more of it would flood the service."""
        time.sleep(0.2)
        until_s = (time.time_ns() - self._t0_ns) * 1e-9
        measured = {x: list(takewhile(lambda part: part.due_s < until_s, parts)) for x, parts in self._at.items()}
        for index in range(self._tags):
            self._post(service, index, [part for part in measured[self.anchor_x] if part.tag == index])

    def _post(self, service: Running, index: int, parts: Sequence[Delivery]) -> None:
        for batch in batched(parts, 100):
            frame = Frame([one for part in batch for one in part.imu], [one for part in batch for one in part.ranges])
            headers = {"content-type": ENCODING_PACKED}
            body = encode_packed(frame)
            service.ask(
                "POST", f"/api/v1/ingest/samples?tag=cart-{index}", content=body, headers=headers
            ).raise_for_status()

    def until(
        self, service: Running, is_wanted: Callable[[Pose], bool], least: Callable[[Pose], bool] = bool
    ) -> list[Pose]:
        """Send until the new poses of all tags are wanted, and return them. least: what one of them has to be too."""
        found: list[list[Pose]] = []
        since_ns = time.time_ns()

        def have_it() -> bool:
            self.send(service)
            found.append([pose for pose in service.get("/api/v1/poses")["poses"] if pose["t_ns"] > since_ns])
            return len(found[-1]) == self._tags and all(map(is_wanted, found[-1])) and any(map(least, found[-1]))

        wait_until(have_it)
        return found[-1]


def batched(parts: Sequence[Delivery], size: int) -> Iterator[Sequence[Delivery]]:
    return (parts[first : first + size] for first in range(0, len(parts), size))


def is_doubted(pose: Pose) -> bool:
    return bool(pose["reason"] == StateReason.ANCHOR_DOUBTED)


def test_tags_of_an_anchor_that_somebody_moves_are_ambiguous_until_its_place_is_told() -> None:
    sender = Sender(tags=5)
    with running_service() as service:
        sender.until(service, lambda pose: pose["reason"] == StateReason.RESOLVED)
        sender.anchor_x = FARTHER_X
        poses = sender.until(service, lambda pose: bool(pose["state"] == "ambiguous"), least=is_doubted)
        assert {pose["state"] for pose in poses} == {"ambiguous"}  # some for another reason, too
        assert all(pose["hint"].startswith("Anchor 1 seems to have moved by ") for pose in filter(is_doubted, poses))
        service.put("/api/v1/anchors/1", {"id": "1", "x": FARTHER_X})
        sender.until(service, lambda pose: not is_doubted(pose))


def test_the_tags_of_a_corrected_anchor_shift_with_it_and_back_also_over_a_restart(tmp_path: Path) -> None:
    sender, options = Sender(), ("--data-dir", str(tmp_path))

    def tracked(service: Running) -> Pose:
        return sender.until(service, lambda pose: bool(pose["state"] == "tracking"))[0]

    with running_service(*options) as service:
        before = tracked(service)
        service.put("/api/v1/anchors/1", {"id": "1", "x": CORRECTED_X})
        shifted = tracked(service)
        assert abs(shifted["x"] - before["x"] - CORRECTED_X) < WAY_M
        assert shifted["t_ns"] - before["t_ns"] < FOUND_AGAIN_NS
        service.stop(signal.SIGTERM)
    with running_service(*options) as service:
        service.put("/api/v1/anchors/1", {"id": "1", "x": 0.0})
        back = tracked(service)
    assert abs(back["x"] - before["x"]) < WAY_M
