"""A client reports its health under its own key, and what its machine and its spool know goes with it."""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dropanchor_schemas import keys
from dropanchor_schemas.wire import ENCODING_JSON, Frame, RangeSample, Reason, encode_json, encode_packed
from dropanchor_tag_client import TagClient, Upkeep
from dropanchor_tag_client.host import host_health, program
from dropanchor_tag_client.spooling import first_ns
from support.zenoh_router import connected_session, free_endpoint, make_known, router_process, wait_until

T = 1_760_000_000_000_000_000
FIVE_RANGES = [RangeSample(T + i, 1, 1.0) for i in range(5)]


@contextmanager
def reports(endpoint: str) -> Iterator[list[tuple[str, str, dict[str, Any]]]]:
    """Subscribe to the health of all tags: key, encoding and values."""
    received: list[tuple[str, str, dict[str, Any]]] = []
    with (
        connected_session(endpoint) as session,
        session.declare_subscriber(
            keys.all_tags("default", "health"),
            lambda m: received.append((str(m.key_expr), str(m.encoding), json.loads(bytes(m.payload)))),
        ),
    ):
        make_known(session)
        yield received


def test_a_report_has_the_key_of_its_tag_and_only_what_a_tag_can_measure(router_endpoint: str) -> None:
    with reports(router_endpoint) as received, TagClient("tag 1", connect=router_endpoint) as tag:
        assert tag.publish_health(battery_fraction=0.5, temperature_c=math.nan, rssi_dbm=1e9, firmware="x" * 70)
        assert not tag.publish_health()
        wait_until(lambda: received)
    (key, encoding, values), *more = received
    assert (key, encoding, more) == ("dropanchor/@v1/default/tag/tag%201/health", ENCODING_JSON, [])
    assert values == {"version": 1, "battery_fraction": 0.5, "firmware": "x" * 64}
    assert tag.refused == {Reason.HEALTH_ABSURD: 2}


def test_upkeep_reports_again_and_again_and_calls_for_the_values_each_time(router_endpoint: str) -> None:
    levels = iter([0.9, 0.8, 0.7])
    with (
        reports(router_endpoint) as received,
        TagClient("a", connect=router_endpoint) as tag,
        Upkeep([tag], lambda: {"battery_fraction": next(levels, 0.6)}, period_s=0.05),
    ):
        wait_until(lambda: len(received) >= 4)
    assert [values["battery_fraction"] for _, _, values in received][:4] == [0.9, 0.8, 0.7, 0.6]


def test_a_tag_with_a_spool_reports_what_waits_there_as_soon_as_it_is_connected(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with TagClient("a", connect=endpoint, spool=tmp_path) as tag, Upkeep([tag], period_s=0.05):
        for _ in range(100):
            tag.publish_range(1, 1.0)
        tag.flush()
        wait_until(lambda: tag.spool_counts is not None and tag.spool_counts.waiting_bytes > 0)
        with router_process(endpoint), reports(endpoint) as received:
            wait_until(lambda: received)
    (_, _, values), *_ = received
    assert values["spool_bytes"] > 1000
    assert values["lost_messages"] == 0


def test_the_time_of_a_spooled_message_is_that_of_its_first_sample() -> None:
    frame = Frame(ranges=FIVE_RANGES)
    assert first_ns(encode_packed(frame)) == first_ns(encode_json(frame)) == T
    assert first_ns(b"") is first_ns(b"{}") is None


def test_linux_knows_battery_temperature_and_signal_of_a_machine(tmp_path: Path) -> None:
    assert host_health(tmp_path) == {}
    for path, text in {
        "sys/class/power_supply/AC/type": "Mains",
        "sys/class/power_supply/mouse/type": "Battery",
        "sys/class/power_supply/mouse/scope": "Device",
        "sys/class/power_supply/mouse/capacity": "11",
        "sys/class/power_supply/power/type": "Battery",
        "sys/class/power_supply/power/capacity": "83",
        "sys/class/power_supply/power/voltage_now": "3920000",
        "sys/class/thermal/thermal_zone0/temp": "48200",
        "proc/net/wireless": "Inter-| sta-|   Quality\n wlan0: 0000   54.  -56.  -256        0\n",
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(f"{text}\n")
    assert host_health(tmp_path) == {
        "battery_fraction": 0.83,
        "battery_v": 3.92,
        "temperature_c": 48.2,
        "rssi_dbm": -56.0,
    }


def test_the_program_names_its_version() -> None:
    assert program() == f"dropanchor-tag {version('dropanchor-tag-client')}"
