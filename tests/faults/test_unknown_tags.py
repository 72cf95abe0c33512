"""A flood of unknown tags takes little memory and costs known tags no sample."""

import os
from pathlib import Path
from typing import Any

import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.wire import ENCODING_PACKED, encode_packed
from dropanchor_tag_client import TagClient
from support.patience import PATIENCE_S
from support.service import Running, running_service, settings_file, straight_north
from support.zenoh_router import connected_session, wait_until

UNKNOWN = int(os.environ.get("DROPANCHOR_UNKNOWN_TAGS_SENT", "5000"))
"""The figures in service/docs/results/survives.md are for 100,000. `pytest -s` prints them."""

NOTHING_LOST: dict[str, Any] = {
    "encoding": ENCODING_PACKED,
    "congestion_control": zenoh.CongestionControl.BLOCK,  # otherwise Zenoh would drop a part of the flood
}
MIB = 2**20
MAX_GROWTH_MIB = 50.0


def resident_mib(service: Running) -> float:
    pages = int(Path(f"/proc/{service.process.pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MIB


def known_tag_sends(service: Running, client: TagClient, count: int = 20) -> int:
    """Publish ranges of the known tag. Return how many of its messages were used so far."""
    for sample in straight_north(count).ranges:
        client.publish_range(7, sample.range_m, t_ns=sample.t_ns)
        client.flush()
    return int(service.get("/api/v1/tags/known")["messages"])


@pytest.mark.parametrize(
    ("policy", "reason", "rows", "pending"),
    [
        ("", "tag_unconfirmed", 200, True),
        ('unknown_tags = "quarantine"', "tag_quarantined", 0, False),
        ("max_tags = 50", "tags_full", 49, False),
    ],
    ids=["default", "quarantine", "full"],
)
def test_a_flood_of_unknown_tags_is_counted_and_costs_the_known_tag_no_sample(
    tmp_path: Path, policy: str, reason: str, rows: int, pending: bool
) -> None:
    config = settings_file(tmp_path, ["known"], policy)
    frame = encode_packed(straight_north(1))
    with (
        running_service("--config", str(config)) as service,
        TagClient("known", connect=service.zenoh, connect_timeout_s=PATIENCE_S) as known,
        connected_session(service.zenoh) as flood,
    ):
        wait_until(lambda: known_tag_sends(service, known) > 0)
        sent_before, before_mib = known.sent.messages, resident_mib(service)
        seen_mib = []
        for number in range(UNKNOWN):
            flood.put(keys.samples_key("default", f"made-up-{number}"), frame, **NOTHING_LOST)
            if number % (UNKNOWN // 20) == 0:
                known_tag_sends(service, known, count=5)
                seen_mib.append(resident_mib(service))
        refused = f'dropanchor_rejected_total{{reason="{reason}"}}'
        shed = 'dropanchor_rejected_total{reason="shed"}'
        lost = UNKNOWN - rows

        def accounted() -> float:
            return service.metric(refused) + service.metric(shed) + pending * service.metric("dropanchor_tags_pending")

        wait_until(lambda: accounted() >= lost)
        assert accounted() == lost
        # A message that both Zenoh and a cache recovered arrives twice, but counts once.
        wait_until(lambda: service.get("/api/v1/tags/known")["samples"] == {"range": known.sent.samples})
        assert known.sent.messages >= sent_before + 100
        assert service.get("/api/v1/tags/known")["rejected"].get("shed", 0) == 0
        assert service.metric("dropanchor_tags_registered") == 1 + rows
        more_mib = max(*seen_mib, resident_mib(service)) - before_mib
        print(f"{UNKNOWN} unknown tags, {reason}: {more_mib:+.1f} MiB")  # noqa: T201
        assert more_mib <= MAX_GROWTH_MIB
