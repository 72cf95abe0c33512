"""Memory stays bounded. This test runs only on request: DROPANCHOR_SOAK_S=1800 DROPANCHOR_SOAK_TAGS=200."""

import logging
import os
import time
from pathlib import Path

import numpy as np
import pytest

from support.live_tags import LiveTags
from support.service import Running, running_service
from support.zenoh_router import free_endpoint, router_process, wait_until

SOAK_S = float(os.environ.get("DROPANCHOR_SOAK_S", "0"))
TAGS = int(os.environ.get("DROPANCHOR_SOAK_TAGS", "200"))
MAX_MB_PER_H = 1.0
SAMPLE_PERIOD_S = 5.0

_log = logging.getLogger(__name__)


def resident_mb(service: Running) -> float:
    status = Path(f"/proc/{service.process.pid}/status").read_text()
    return next(float(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmRSS:"))


@pytest.mark.skipif(SOAK_S == 0, reason="set DROPANCHOR_SOAK_S to the seconds that this test should run")
def test_memory_does_not_grow_once_the_service_is_warm(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    tags = LiveTags(endpoint, TAGS, seed=7, step_s=0.2)
    config = tags.write_settings(tmp_path)
    options = ("--config", str(config), "--data-dir", str(tmp_path / "data"), "--zenoh-connect", endpoint)
    with router_process(endpoint), tags, running_service(*options) as service:
        wait_until(lambda: len(service.get("/api/v1/poses")["poses"]) == TAGS, 600.0)
        begin_s = time.monotonic()
        seen = []
        while time.monotonic() - begin_s < SOAK_S:
            time.sleep(SAMPLE_PERIOD_S)
            seen.append((time.monotonic() - begin_s, resident_mb(service)))
    times_s, sizes_mb = np.array(seen).T
    warm = times_s > SOAK_S / 3
    slope = float(np.polyfit(times_s[warm] / 3600, sizes_mb[warm], 1)[0])
    _log.info("%d tags, %.0f s: %.1f MB, slope %.2f MB/h", TAGS, SOAK_S, sizes_mb[-1], slope)
    assert slope < MAX_MB_PER_H
