"""A real service, and tags whose times are in another unit or whose two sensors have two clocks."""

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dropanchor_schemas import keys
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED, Frame, RangeSample, encode_json, encode_packed
from support.commands import python, start_python
from support.patience import PATIENCE_S
from support.service import Running, running_service, settings_file
from support.zenoh_router import connected_session, wait_until

S = 1_000_000_000
SAMPLES = "/api/v1/ingest/samples"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    config: Path = settings_file(tmp_path_factory.mktemp("service"), ["packed", "json", "http", "cart"])
    with running_service("--config", str(config)) as running:
        yield running


def in_ms() -> Frame:
    return Frame(ranges=[RangeSample(time.time_ns() // 10**6, 7, 12.5)])


def assert_told(service: Running, tag: str) -> None:
    wait_until(lambda: service.get(f"/api/v1/tags/{tag}")["rejected"] == {"time_not_utc": 1})
    assert (
        "look like milliseconds, not nanoseconds: multiply them by 1000000, or"
        in (service.get(f"/api/v1/tags/{tag}")["hint"])
    )
    answer = service.ask("GET", f"/api/v1/tags/{tag}/pose")
    assert answer.status_code == 404
    assert "look like milliseconds" in answer.json()["detail"]


def test_milliseconds_over_zenoh_are_told_for_their_tag(service: Running) -> None:
    with connected_session(service.zenoh) as session:
        for tag, encoding, encode in (
            ("packed", ENCODING_PACKED, encode_packed),
            ("json", ENCODING_JSON, encode_json),
        ):
            session.put(keys.samples_key("default", tag), encode(in_ms()), encoding=encoding)
            assert_told(service, tag)


def test_milliseconds_over_http_are_told_at_once_and_for_their_tag(service: Running) -> None:
    headers = {"content-type": ENCODING_JSON}
    refused = service.ask("POST", f"{SAMPLES}?tag=http", content=encode_json(in_ms()), headers=headers)
    assert (refused.status_code, refused.json()["reason"]) == (422, "time_not_utc")
    assert_told(service, "http")


def test_the_command_publish_names_the_line_and_fails(service: Running) -> None:
    line = json.dumps({"anchor": 7, "range_m": 12.5, "t_ns": time.time_ns() // 1000})
    command = ("-m", "dropanchor_tag_client", "publish", "--tag", "lines", "--connect", service.zenoh)
    done = python(*command, text_input=f"{line}\n")
    assert done.returncode == 1
    assert "line 1: t_ns is 1970-01-" in done.stderr
    assert "looks like microseconds; multiply it by 1000" in done.stderr
    assert "0 samples sent, 1 bad lines" in done.stderr


def test_motion_from_the_future_is_aligned_with_the_ranges_of_its_tag(service: Running) -> None:
    process = start_python("-m", "dropanchor_tag_client", "publish", "--tag", "cart", "--connect", service.zenoh)
    assert process.stdin is not None
    try:
        for number in range(200):
            t_ns = time.time_ns()
            imu = {
                "acc": [0.01 * (number % 3), 0, 9.81],
                "gyro": [0, 0, 0.001 * (number % 2)],
                "t_ns": t_ns + 31 * S // 10,
            }
            lines = [imu] if number % 5 else [imu, {"anchor": 7, "range_m": 22.36 + 0.001 * (number % 7), "t_ns": t_ns}]
            process.stdin.write("".join(json.dumps(line) + "\n" for line in lines))
            process.stdin.flush()
            time.sleep(0.02)
    finally:
        process.communicate(timeout=PATIENCE_S)
    wait_until(lambda: service.get("/api/v1/tags/cart")["samples"] == {"imu": 200, "range": 40})
    wait_until(lambda: (service.get("/api/v1/tags/cart")["clock_offset"] or {}).get("corrected"))
    status = service.get("/api/v1/tags/cart")
    assert status["clock_offset"]["offset_s"] == pytest.approx(3.1, abs=0.3)
    assert [care["reason"] for care in status["needs_care"]] == ["clock_offset"]
    assert set(status["rejected"]) <= {"duplicate"}  # a message that was late, and fetched meanwhile, comes twice
