"""Lines of JSON on standard input become samples; bad lines are named, and stop nothing."""

import io
import json
import time

import pytest

from dropanchor_schemas import keys
from dropanchor_schemas.wire import anchor_number
from dropanchor_tag_client import TagClient
from dropanchor_tag_client.sources.publish import publish_lines
from support.commands import python, start_python
from support.listening import ReceivedFrames, listening
from support.patience import PATIENCE_S
from support.zenoh_router import connected_session, make_known, wait_until

T = 1_760_000_000_000_000_000


def published(endpoint: str, lines: bytes, expected: int) -> tuple[ReceivedFrames, int, list[str], TagClient]:
    """What is heard, the number of bad lines, and what was said of them."""
    errors = io.StringIO()
    with listening(endpoint) as heard:
        with TagClient("a", connect=endpoint) as client:
            bad = publish_lines(client, io.BytesIO(lines), errors)
        wait_until(lambda: sum(len(frame) for frame in heard.frames) == expected)
    return heard, bad, errors.getvalue().splitlines(), client


def test_single_samples_and_messages_are_published(router_endpoint: str) -> None:
    lines = f"""
{{"anchor": 7, "range_m": 3.5, "std_m": null, "t_ns": {T}}}
{{"acc": [0, 0, 9.75], "gyro": [0, 0, 0.5], "mag": [0, 20, -44], "t_ns": {T}}}
{{"heading_rad": 1.5, "t_ns": {T}}}
{{"anchor": "L0", "bearing_rad": 0.25, "std_rad": 0.125, "t_ns": {T}}}
{{"clock": "utc", "sequence": 9, "range": [{{"t_ns": {T}, "anchor": "L0", "range_m": 4}}], "heading": []}}
"""
    heard, bad, said, _ = published(router_endpoint, lines.encode(), 5)
    (frame,) = heard.frames
    assert (bad, said) == (0, [])
    assert [(s.t_ns, s.anchor, s.range_m) for s in frame.ranges] == [(T, 7, 3.5), (T, anchor_number("L0"), 4.0)]
    assert frame.imu == [(T, (0.0, 0.0, 9.75), (0.0, 0.0, 0.5), (0.0, 20.0, -44.0))]
    assert frame.headings[0][:2] == (T, 1.5)
    assert frame.bearings[0][1:] == (anchor_number("L0"), 0.25, 0.125)


def test_a_sample_without_a_time_gets_that_of_reading(router_endpoint: str) -> None:
    before_ns = time.time_ns()
    heard, _, _, _ = published(router_endpoint, b'{"heading_rad": 1.5}', 1)
    assert before_ns <= heard.frames[0].headings[0].t_ns <= time.time_ns()


BAD_LINES = [
    (b"hello", "not JSON"),
    (b"\xff\xfe", "not JSON"),
    (b"[1, 2]", "a JSON object was expected"),
    (b"{}", "none of acc, range_m"),
    (b'{"range_m": 1}', "range: anchor is missing"),
    (b'{"anchor": 7, "range_m": "1"}', "range_m is '1', a number was expected"),
    (b'{"anchor": 7, "range_m": true}', "range_m is True, a number was expected"),
    (b'{"anchor": 7, "range_m": null}', "range_m is None, a number was expected"),
    (b'{"anchor": 7, "range_m": NaN}', "NaN is not JSON"),
    (b'{"anchor": 7, "range_m": 1' + b"0" * 400 + b"}", "range_m is too large a number"),
    (b'{"anchor": 7, "range_m": 1, "t_ns": 1.5}', "t_ns is 1.5, an integer was expected"),
    (b'{"anchor": 7.5, "range_m": 1}', "anchor is 7.5, a number or a text was expected"),
    (b'{"anchor": -1, "range_m": 1}', "an anchor number is between"),
    (b'{"anchor": "", "range_m": 1}', "an id has 1 to 64 characters, this one has 0"),
    (b'{"anchor": 7, "range_m": 1, "rssi": -80}', "range: there is no field 'rssi'"),
    (b'{"acc": [0, 0], "gyro": [0, 0, 0]}', "acc is [0, 0], a list of three numbers was expected"),
    (b'{"acc": [0, 0, 9]}', "imu: gyro is missing"),
    (b'{"range": 5}', "range: a list of objects was expected"),
    (b'{"range": [{"range_m": 1}]}', "range: anchor is missing"),
    (b'{"range": [], "ranges": []}', "a samples message has no field 'ranges'"),
    (b'{"version": 2, "range": []}', "version 2 is not known"),
    (b'{"clock": "boot", "range": []}', "the clock is 'boot'"),
    (b'{"anchor": 7, "range_m": 1, "t_ns": "yesterday"}', "t_ns is 'yesterday', a time in ns, or as ISO 8601"),
    (b'{"anchor": 7, "range_m": 1, "t": 5}', "t is 5, a time in ns, or as ISO 8601 with a time zone"),
    (b'{"anchor": 7, "range_m": 1, "t": "2026-11-26T12:00:00Z", "t_ns": 1}', "there are both t and t_ns"),
    (b"[" * 100_000, "the JSON is nested too deeply"),
    (b" " * 3_000_000 + b"1", "the line is longer than"),
]


def test_every_kind_of_bad_line_is_named_and_the_good_ones_between_are_sent(router_endpoint: str) -> None:
    good = b'{"anchor": 7, "range_m": 1.5}'
    lines = b"\n".join(line for bad, _ in BAD_LINES for line in (bad, good))
    heard, bad, said, client = published(router_endpoint, lines, len(BAD_LINES))
    assert bad == len(BAD_LINES)
    for i, (line, (_, message)) in enumerate(zip(said, BAD_LINES, strict=True)):
        assert line.startswith(f"line {2 * i + 1}: "), line
        assert message in line
        assert len(line) < 300
    assert heard.ranges() == [1.5] * len(BAD_LINES)
    assert not client.refused


def test_times_may_be_written_as_iso_8601(router_endpoint: str) -> None:
    lines = b"""
{"anchor": 7, "range_m": 3.5, "t": "2026-11-26T12:00:00.123456789Z"}
{"anchor": 7, "range_m": 3.5, "t_ns": "2026-11-26t13:00:00.123456789+01:00"}
{"range": [{"anchor": 7, "range_m": 3.5, "t": "2026-11-26T12:00:00.123456789z"}]}
"""
    heard, bad, said, _ = published(router_endpoint, lines, 3)
    assert (bad, said) == (0, [])
    assert {sample.t_ns for frame in heard.frames for sample in frame.ranges} == {1_795_694_400_123_456_789}


@pytest.mark.parametrize(
    ("t_ns", "said"),
    [
        (T // 10**9, "looks like seconds; multiply it by 1000000000"),
        (T // 10**6, "looks like milliseconds; multiply it by 1000000"),
        (T // 10**3, "looks like microseconds; multiply it by 1000"),
        (12_345_000_000, "counts from a start, such as boot; say clock boot (flag bit 0)"),
    ],
)
def test_a_time_that_cannot_be_utc_is_named_with_its_unit_and_none_of_its_line_is_sent(
    router_endpoint: str, t_ns: int, said: str
) -> None:
    line = f'{{"range": [{{"anchor": 7, "range_m": 1}}, {{"anchor": 7, "range_m": 2, "t_ns": {t_ns}}}]}}\n'
    heard, bad, errors, _ = published(router_endpoint, f'{line}{{"heading_rad": 1, "t_ns": {T}}}'.encode(), 1)
    assert bad == 1
    assert errors[0].startswith("line 1: t_ns is 1970-01-")
    assert f"{t_ns} {said}" in errors[0]
    assert heard.ranges() == []


def test_a_clock_that_is_reset_while_lines_come_goes_on(router_endpoint: str) -> None:
    lines = f'{{"heading_rad": 1, "t_ns": {T}}}\n{{"heading_rad": 2, "t_ns": 5000000000}}'
    heard, bad, _, _ = published(router_endpoint, lines.encode(), 2)
    assert bad == 0
    assert [sample.t_ns for frame in heard.frames for sample in frame.headings] == [T, 5_000_000_000]


def test_a_boot_clock_may_have_any_time(router_endpoint: str) -> None:
    errors = io.StringIO()
    with listening(router_endpoint) as heard:
        with TagClient("a", connect=router_endpoint, clock="boot") as client:
            assert publish_lines(client, io.BytesIO(b'{"heading_rad": 1, "t_ns": 5}'), errors, clock="boot") == 0
        wait_until(lambda: heard.frames)
    assert heard.frames[0].boot_clock


def test_a_line_about_the_tag_is_reported_as_its_health(router_endpoint: str) -> None:
    lines = b'{"battery_fraction": 0.5, "firmware": "1.2"}\n{"firmware": 1}\n{"battery_v": "3"}\n'
    heard: list[bytes] = []
    key, errors = keys.health_key("default", "a"), io.StringIO()
    with (
        connected_session(router_endpoint) as session,
        session.declare_subscriber(key, lambda message: heard.append(bytes(message.payload))),
        TagClient("a", connect=router_endpoint) as tag,
    ):
        make_known(session)
        assert publish_lines(tag, io.BytesIO(lines), errors) == 2
        wait_until(lambda: heard)
    assert [json.loads(payload) for payload in heard] == [{"version": 1, "battery_fraction": 0.5, "firmware": "1.2"}]
    assert errors.getvalue().splitlines() == [
        "line 2: firmware is 1, a text was expected",
        "line 3: battery_v is '3', a number was expected",
    ]


def test_a_message_with_one_bad_sample_publishes_none_of_it(router_endpoint: str) -> None:
    lines = b'{"range": [{"anchor": 7, "range_m": 1}, {"anchor": 7}]}\n{"heading_rad": 1}'
    heard, bad, _, _ = published(router_endpoint, lines, 1)
    assert bad == 1
    assert heard.ranges() == []


@pytest.mark.parametrize(("lines", "code"), [('{"heading_rad": 1}\n', 0), ('{"heading_rad": 1}\nx\n', 1)])
def test_the_command_reads_standard_input_and_its_exit_code_tells_of_bad_lines(
    router_endpoint: str, lines: str, code: int
) -> None:
    command = ("-m", "dropanchor_tag_client", "publish", "--tag", "a", "--connect", router_endpoint)
    with listening(router_endpoint) as heard:
        done = python(*command, text_input=lines)
        wait_until(lambda: heard.frames)
    assert done.returncode == code, done.stderr
    assert f"1 samples sent, {code} bad lines" in done.stderr


def test_lines_are_published_while_the_input_is_still_open(router_endpoint: str) -> None:
    with listening(router_endpoint) as heard:
        command = ("-m", "dropanchor_tag_client", "publish", "--tag", "a", "--connect", router_endpoint)
        process = start_python(*command)
        assert process.stdin is not None
        process.stdin.write('{"heading_rad": 1}\n')
        process.stdin.flush()
        wait_until(lambda: heard.frames)
        process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
