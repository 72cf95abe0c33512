"""A tag client with a real router: everything it publishes arrives, complete and in order."""

import logging
import math
import threading
import time
from pathlib import Path
from typing import Literal

import pytest

from dropanchor_schemas import keys
from dropanchor_schemas.wire import Reason, anchor_number
from dropanchor_tag_client import ConnectError, SessionSettings, TagClient
from support.listening import listening
from support.patience import PATIENCE_S
from support.zenoh_router import connected_session, free_endpoint, running_router, wait_until

T = 1_760_000_000_000_000_000


@pytest.mark.parametrize("encoding", ["packed", "json"])
def test_every_kind_of_sample_arrives_in_either_encoding(
    router_endpoint: str, encoding: Literal["packed", "json"]
) -> None:
    with listening(router_endpoint) as heard:
        with TagClient("tag 1", connect=router_endpoint, encoding=encoding) as tag:
            tag.publish_range("L0", 2.5, t_ns=T, std_m=0.25)
            tag.publish_imu((0.5, 0.25, 9.75), (0.0, 0.0, 1.0), (1.0, 2.0, 3.0), t_ns=T + 1000)
            tag.publish_heading(1.5, t_ns=T + 2000)
            tag.publish_bearing(7, -0.5, t_ns=T + 3000, std_rad=0.125)
            tag.publish_pressure(101_325, t_ns=T + 4000, temperature_c=21.5)
        wait_until(lambda: heard.frames)
    (frame,) = heard.frames
    assert heard.keys == ["dropanchor/@v1/default/tag/tag%201/samples"]
    assert frame.ranges == [(T, anchor_number("L0"), 2.5, 0.25)]
    assert frame.imu == [(T + 1000, (0.5, 0.25, 9.75), (0.0, 0.0, 1.0), (1.0, 2.0, 3.0))]
    assert frame.headings[0][:2] == (T + 2000, 1.5)
    assert math.isnan(frame.headings[0].std_rad)
    assert frame.bearings == [(T + 3000, 7, -0.5, 0.125)]
    assert frame.pressures == [(T + 4000, 101_325.0, 21.5)]
    assert (frame.sequence, frame.boot_id, frame.boot_clock) == (0, tag.boot_id, False)
    assert frame.anchor_names == ({} if encoding == "packed" else {anchor_number("L0"): "L0"})


def test_a_full_batch_is_sent_immediately_and_messages_are_numbered(router_endpoint: str) -> None:
    with listening(router_endpoint) as heard:
        with TagClient("a", connect=router_endpoint, batch_samples=5, batch_s=None) as tag:
            for i in range(12):
                tag.publish_range(1, float(i), t_ns=T + i)
            wait_until(lambda: len(heard.frames) == 2)
        wait_until(lambda: len(heard.frames) == 3)
    assert [len(frame) for frame in heard.frames] == [5, 5, 2]
    assert [frame.sequence for frame in heard.frames] == [0, 1, 2]
    assert heard.ranges() == [float(i) for i in range(12)]
    assert tag.sent[:2] == (12, 3)


def test_a_single_sample_is_sent_after_the_batch_time(router_endpoint: str) -> None:
    with listening(router_endpoint) as heard, TagClient("a", connect=router_endpoint, batch_s=0.05) as tag:
        tag.publish_range(1, 1.0)
        wait_until(lambda: heard.ranges() == [1.0])
        tag.publish_range(1, 2.0)
        wait_until(lambda: heard.ranges() == [1.0, 2.0])


def test_flush_sends_the_buffered_samples(router_endpoint: str) -> None:
    with listening(router_endpoint) as heard, TagClient("a", connect=router_endpoint, batch_s=None) as tag:
        tag.publish_range(1, 1.0)
        tag.flush()
        wait_until(lambda: heard.ranges() == [1.0])


def test_samples_too_far_apart_for_one_message_are_sent_in_several(router_endpoint: str) -> None:
    with listening(router_endpoint) as heard:
        with TagClient("a", connect=router_endpoint, batch_s=None) as tag:
            for hour in range(3):
                tag.publish_range(1, float(hour), t_ns=T + hour * 3_600_000_000_000)
        wait_until(lambda: len(heard.frames) == 3)
    assert [frame.ranges[0].t_ns - T for frame in heard.frames] == [hour * 3_600_000_000_000 for hour in range(3)]


def test_many_threads_can_publish_through_one_client(router_endpoint: str) -> None:
    with listening(router_endpoint) as heard:
        with TagClient("a", connect=router_endpoint, batch_samples=7, batch_s=0.001) as tag:

            def publish(worker: int) -> None:
                for i in range(100):
                    tag.publish_range(worker, float(i))

            workers = [threading.Thread(target=publish, args=(n,)) for n in range(8)]
            for worker in workers:
                worker.start()
            for worker in workers:
                worker.join()
        wait_until(lambda: len(heard.ranges()) == 800)
    assert [frame.sequence for frame in heard.frames] == list(range(len(heard.frames)))
    for n in range(8):
        own = [s.range_m for frame in heard.frames for s in frame.ranges if s.anchor == n]
        assert own == [float(i) for i in range(100)]


def test_several_tags_share_a_session_that_stays_open(router_endpoint: str) -> None:
    with listening(router_endpoint) as heard, connected_session(router_endpoint) as session:
        with TagClient("a", connect=session) as a, TagClient("b", connect=session, cache_messages=0) as b:
            a.publish_range(1, 1.0)
            b.publish_range(1, 2.0)
        wait_until(lambda: sorted(heard.ranges()) == [1.0, 2.0])
        assert not session.is_closed()
    assert a.boot_id != b.boot_id
    assert sorted(heard.keys) == [keys.samples_key("default", "a"), keys.samples_key("default", "b")]


def test_the_liveliness_token_exists_as_long_as_the_client_is_open(router_endpoint: str) -> None:
    def alive() -> list[str]:
        replies = session.liveliness().get(keys.all_tags("yard", "alive"), timeout=PATIENCE_S)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    with connected_session(router_endpoint) as session:
        with TagClient("a", site="yard", connect=router_endpoint):
            wait_until(lambda: alive() == ["dropanchor/@v1/yard/tag/a/alive"])
        wait_until(lambda: alive() == [])


def test_a_boot_clock_counts_from_the_start_of_the_machine(router_endpoint: str) -> None:
    with listening(router_endpoint) as heard:
        before_ns = time.monotonic_ns()
        with TagClient("a", connect=router_endpoint, clock="boot") as tag:
            tag.publish_range(1, 1.0)
        wait_until(lambda: heard.frames)
    assert heard.frames[0].boot_clock
    assert before_ns <= heard.frames[0].ranges[0].t_ns <= time.monotonic_ns()


@pytest.mark.parametrize("encoding", ["packed", "json"])
def test_invalid_samples_are_dropped_and_counted_and_the_rest_is_sent(
    router_endpoint: str, encoding: Literal["packed", "json"], caplog: pytest.LogCaptureFixture
) -> None:
    with listening(router_endpoint) as heard:
        with TagClient("a", connect=router_endpoint, encoding=encoding) as tag:
            for bad in (math.nan, math.inf, -math.inf, 1e39):
                tag.publish_range(1, bad)
                tag.publish_imu((0.0, bad, 0.0), (0.0, 0.0, 0.0))
            tag.publish_range(1, 2.0, t_ns=-1)
            tag.publish_range(1, 2.0, t_ns=2**62)
            tag.publish_heading(0.0, std_rad=math.inf)
            tag.publish_range(1, 3.0)
        wait_until(lambda: heard.ranges() == [3.0])
    assert tag.refused == {Reason.NOT_FINITE: 8, Reason.TIME_OUT_OF_RANGE: 2, Reason.STD_INVALID: 1}
    assert len(caplog.records) == 3


def test_invalid_calls_raise_errors(router_endpoint: str) -> None:
    with TagClient("a", connect=router_endpoint) as tag:
        with pytest.raises(ValueError, match="acc has three components, not 2"):
            tag.publish_imu((0.0, 0.0), (0.0, 0.0, 0.0))
        for anchor in ("", "x" * 65, "..", "a\nb"):
            with pytest.raises(keys.InvalidKeyError):
                tag.publish_range(anchor, 1.0)
        with pytest.raises(ValueError, match="between 0"):
            tag.publish_range(-1, 1.0)
        with pytest.raises(RuntimeError, match="is already open"):
            tag.open()
    with pytest.raises(RuntimeError, match="is not open"):
        tag.publish_range(1, 1.0)
    tag.close()
    with pytest.raises(ValueError, match="batch_samples is 0"):
        TagClient("a", batch_samples=0)
    for name in ("", ".", ".."):
        with pytest.raises(keys.InvalidKeyError):
            TagClient(name)


def test_a_tag_whose_id_cannot_name_a_folder_has_no_spool(tmp_path: Path) -> None:
    TagClient("con")
    for name in ("con", "a.", "é" * 64):
        with pytest.raises(keys.InvalidKeyError, match=r"the name of a file|cannot name a file"):
            TagClient(name, spool=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_router_is_a_clear_error_within_the_timeout() -> None:
    endpoint = free_endpoint()
    with pytest.raises(ConnectError, match=f"Cannot connect to {endpoint}: check the address"):
        TagClient("a", connect=endpoint, connect_timeout_s=0.3).open()


def test_a_client_waits_for_a_router_that_starts_later(caplog: pytest.LogCaptureFixture) -> None:
    endpoint = free_endpoint()
    opened = threading.Event()
    leave = threading.Event()

    def run() -> None:
        with TagClient("a", connect=endpoint):
            opened.set()
            leave.wait(PATIENCE_S)

    caplog.set_level(logging.WARNING)
    thread = threading.Thread(target=run)
    thread.start()
    wait_until(lambda: "Still trying." in caplog.text)
    assert not opened.is_set()
    with running_router(endpoint):
        assert opened.wait(PATIENCE_S)
        leave.set()
        thread.join()


def test_a_password_admits_a_client_and_a_wrong_one_does_not(tmp_path: Path) -> None:
    users = tmp_path / "users.txt"
    users.write_text("tag-a:secret\n")
    endpoint = free_endpoint()
    auth = {"auth": {"usrpwd": {"user": "router", "password": "r", "dictionary_file": str(users)}}}
    with running_router(endpoint, auth):
        good = SessionSettings(connect=endpoint, user="tag-a", password="secret")
        with TagClient("a", connect=good, connect_timeout_s=PATIENCE_S) as tag:
            tag.publish_range(1, 1.0)
        wrong = SessionSettings(connect=endpoint, user="tag-a", password="guess")
        with pytest.raises(ConnectError, match="user and password"):
            TagClient("a", connect=wrong, connect_timeout_s=0.5).open()
        with pytest.raises(ConnectError, match="requires a certificate or a password"):
            TagClient("a", connect=endpoint, connect_timeout_s=0.5).open()
    assert "guess" not in repr(wrong)
