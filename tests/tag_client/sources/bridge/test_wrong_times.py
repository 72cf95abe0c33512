"""Messages of a broker whose times are in another unit than the rules say are left out, with a sentence."""

import json
import logging
from pathlib import Path

import pytest

from dropanchor_tag_client.sources.bridge.measurement import Drop, Format, Received
from dropanchor_tag_client.sources.bridge.pipe import Bridge
from dropanchor_tag_client.sources.bridge.sensor_logger import SensorLogger
from dropanchor_tag_client.sources.bridge.template import Template
from support.listening import listening
from support.sensor_logger import G, message, reading
from support.zenoh_router import wait_until

T = 1_760_000_000_000_000_000
RULES = """
[[rule]]
topic = "plant/+/uwb"
tag = "{1}"
kind = "range"
fields = { anchor = "id", range_m = "m", t_ns = "at" }
"""


def test_times_that_cannot_be_utc_are_left_out_and_told_with_their_unit(
    router_endpoint: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "rules.toml").write_text(RULES)
    formats: list[Format] = [Template(tmp_path / "rules.toml"), SensorLogger("phone/+")]
    options = {"connect": router_endpoint, "batch_s": None}
    phone = message(0, [reading(name, T // 1000, (0, 0, G)) for name in ("gyroscope", "totalacceleration")])
    with listening(router_endpoint) as heard, caplog.at_level(logging.WARNING):
        bridge = Bridge(formats, options, "", {})
        bridge.take(Received("plant/hall/uwb", json.dumps({"id": 3, "m": 2.5, "at": T // 10**6}).encode(), T))
        bridge.take(Received("phone/anna", phone, T))
        assert bridge.dropped == {Drop.NOT_UNDERSTOOD: 2}
        bridge.log_dropped()
        bridge.take(Received("plant/hall/uwb", json.dumps({"id": 3, "m": 3.5, "at": T}).encode(), T))
        bridge.flush()
        wait_until(lambda: heard.frames)
        bridge.close()
    assert "tag anna: t_ns is 1970-01-" in caplog.text
    assert "looks like microseconds; multiply it by 1000" in caplog.text
    assert heard.ranges() == [3.5]
