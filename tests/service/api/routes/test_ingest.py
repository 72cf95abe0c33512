"""Samples over HTTP: who may send them for which tag, what is answered, what is passed on."""

import gzip
import json
import math
import zlib
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from dropanchor_schemas.answers import PhoneReadingsReceived, SamplesReceived
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    MAX_PAYLOAD_BYTES,
    Frame,
    RangeSample,
    decode_packed,
    encode_json,
    encode_packed,
)
from dropanchor_service.api.app import MAX_BODY_BYTES
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.security.api_keys import SOURCE, ApiKeyError, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from dropanchor_tag_client.sources.phones.problems import TILTED
from support.api import ApiBench, ask, kind_of, make_api_bench
from support.sensor_logger import T_NS, G, message, reading

SAMPLES, PHONE = "/api/v1/ingest/samples", "/api/v1/ingest/sensor-logger"
FRAME = Frame(ranges=[RangeSample(T_NS, 17, 12.5), RangeSample(T_NS + 1000, 17, 12.75)])
BATCH = message(0, [reading("gyroscope", T_NS, (0, 0, 0)), reading("totalacceleration", T_NS, (0, 0, G))])


class Guarded:
    """An interface with a key of the tag anna and one that may change things."""

    def __init__(self, folder: Path, rate_limiter: RateLimiter | None = None) -> None:
        keys = ApiKeys(folder)
        self.anna, self.writer = keys.add_for_tag("anna's phone", "anna"), keys.add("writer", Scope.WRITE)
        self.bench: ApiBench = make_api_bench()
        self.app: FastAPI = self.bench.app(authenticator=Authenticator({SOURCE: keys}), rate_limiter=rate_limiter)

    def post(self, path: str, secret: str, content: bytes = BATCH) -> httpx.Response:
        return ask(self.app, "POST", path, headers={"authorization": f"Bearer {secret}"}, content=content)


@pytest.fixture
def guarded(tmp_path: Path) -> Guarded:
    return Guarded(tmp_path)


def post(bench: ApiBench, path: str, content: bytes, encoding: str = ENCODING_JSON) -> httpx.Response:
    return ask(bench.app(), "POST", path, content=content, headers={"content-type": encoding})


@pytest.mark.parametrize(
    ("payload", "content_type", "encoding"),
    [
        (encode_packed(FRAME), ENCODING_PACKED, ENCODING_PACKED),
        (encode_json(FRAME), ENCODING_JSON, ENCODING_JSON),
        (encode_json(FRAME), "Application/JSON; charset=utf-8", ENCODING_JSON),
    ],
)
def test_a_payload_of_the_contract_is_passed_on_as_it_is(payload: bytes, content_type: str, encoding: str) -> None:
    bench = make_api_bench()
    response = post(bench, f"{SAMPLES}?tag=tag%201", payload, content_type)
    assert response.status_code == 202
    assert SamplesReceived.model_validate(response.json()).samples == 2
    assert bench.received == [("tag 1", payload, encoding)]


@pytest.mark.parametrize(
    ("payload", "encoding", "reason"),
    [
        (b"", ENCODING_JSON, "payload_empty"),
        (b"{", ENCODING_JSON, "json_syntax"),
        (b'{"range": [{"range_m": 1}]}', ENCODING_JSON, "json_schema"),
        (b"{}", ENCODING_JSON, "no_samples"),
        (b'{"version": 2}', ENCODING_JSON, "version_unknown"),
        (b"{}", "text/plain", "encoding_unknown"),
        (b"\x01", ENCODING_PACKED, "header_truncated"),
        (encode_packed(FRAME)[:-1], ENCODING_PACKED, "length_mismatch"),
        (b"\x01" * (MAX_PAYLOAD_BYTES + 1), ENCODING_PACKED, "payload_too_large"),
    ],
)
def test_what_cannot_be_decoded_is_answered_by_its_name_and_passed_on_to_be_counted(
    payload: bytes, encoding: str, reason: str
) -> None:
    bench = make_api_bench()
    response = post(bench, f"{SAMPLES}?tag=a", payload, encoding)
    assert (response.status_code, kind_of(response)) == (422, "samples-rejected")
    assert response.json()["reason"] == reason
    assert bench.received == [("a", payload, encoding)]


@pytest.mark.parametrize("packing", ["gzip", "deflate"])
def test_a_packed_body_is_unpacked(packing: str) -> None:
    bench, payload = make_api_bench(), encode_json(FRAME)
    packed = gzip.compress(payload) if packing == "gzip" else zlib.compress(payload)
    answer = post_packed(bench, packed, packing)
    assert (answer.status_code, answer.json()) == (202, {"samples": 2})
    assert bench.received == [("a", payload, ENCODING_JSON)]


@pytest.mark.parametrize(
    ("packing", "content", "status", "sentence"),
    [
        ("br", b"x", 415, "The Content-Encoding br is not read: gzip, deflate or none is."),
        ("gzip", b"{}", 422, "The body is not whole gzip, which Content-Encoding says it is."),
        ("gzip", gzip.compress(bytes(10))[:-9], 422, "The body is not whole gzip"),
        ("gzip", 2 * gzip.compress(encode_json(FRAME)), 422, "The body is not whole gzip"),  # two, one behind the other
        ("gzip", gzip.compress(bytes(50 * MAX_BODY_BYTES)), 413, "A request body may have at most"),
    ],
)
def test_a_packed_body_that_cannot_be_read_is_told_why(
    packing: str, content: bytes, status: int, sentence: str
) -> None:
    bench = make_api_bench()
    answer = post_packed(bench, content, packing)
    assert answer.status_code == status
    assert sentence in answer.json()["detail"]
    assert not bench.received


def post_packed(bench: ApiBench, content: bytes, packing: str) -> httpx.Response:
    headers = {"content-type": ENCODING_JSON, "content-encoding": packing}
    return ask(bench.app(), "POST", f"{SAMPLES}?tag=a", content=content, headers=headers)


@pytest.mark.parametrize("path", [SAMPLES, PHONE])
def test_without_credentials_the_tag_is_named(path: str) -> None:
    bench = make_api_bench()
    assert "add ?tag=NAME" in post(bench, path, BATCH).json()["detail"]
    for query in ("tag=", f"tag={'x' * 65}", "tag=a%00", "tag=..", "tag=%2E", "tga=a"):
        assert kind_of(post(bench, f"{path}?{query}", BATCH)) == "invalid-request"
    assert bench.received == []


EARLY = {
    "seconds": Frame(ranges=[RangeSample(T_NS // 10**9, 17, 12.5)]),
    "milliseconds": Frame(ranges=[RangeSample(T_NS, 17, 12.5), RangeSample(T_NS // 10**6, 17, 12.5)]),
    "microseconds": Frame(ranges=[RangeSample(T_NS // 1000, 17, 12.5)]),
    "counts from a start": Frame(ranges=[RangeSample(12_345_000_000, 17, 12.5)]),
}


@pytest.mark.parametrize("said", EARLY)
def test_a_time_that_cannot_be_utc_is_named_with_its_unit_and_passed_on_to_be_counted(said: str) -> None:
    bench = make_api_bench()
    bodies = [(encode_json(EARLY[said]), ENCODING_JSON)]
    if len(EARLY[said].ranges) == 1:  # the others do not fit into one packed payload
        bodies.append((encode_packed(EARLY[said]), ENCODING_PACKED))
    for body, encoding in bodies:
        response = post(bench, f"{SAMPLES}?tag=a", body, encoding)
        assert (response.status_code, response.json()["reason"]) == (422, "time_not_utc")
        assert said in response.json()["detail"]
    assert [encoding for _, _, encoding in bench.received] == [encoding for _, encoding in bodies]


@pytest.mark.parametrize("flag", ["boot_clock", "replay"])
def test_a_boot_clock_and_a_replay_have_any_times(flag: str) -> None:
    frame = EARLY["counts from a start"].replaced(**{flag: True})
    for body, encoding in ((encode_json(frame), ENCODING_JSON), (encode_packed(frame), ENCODING_PACKED)):
        assert post(make_api_bench(), f"{SAMPLES}?tag=a", body, encoding).status_code == 202


def test_the_contract_takes_no_iso_times() -> None:
    body = b'{"range": [{"t_ns": "2026-11-26T12:00:00Z", "anchor": 1, "range_m": 2.5}]}'
    response = post(make_api_bench(), f"{SAMPLES}?tag=a", body)
    assert (response.status_code, response.json()["reason"]) == (422, "json_schema")
    assert "range.0.t_ns" in response.json()["detail"]


def test_a_phone_whose_times_are_no_utc_in_ns_is_told_and_its_samples_are_passed_on_to_be_counted() -> None:
    bench, t_ms = make_api_bench(), T_NS // 10**6
    batch = [reading("gyroscope", t_ms, (0, 0, 0)), reading("totalacceleration", t_ms, (0, 0, G))]
    response = post(bench, f"{PHONE}?tag=anna", message(0, batch))
    assert response.status_code == 499
    assert f"{t_ms} looks like milliseconds; multiply it by 1000000" in response.text
    assert [(tag, encoding) for tag, _, encoding in bench.received] == [("anna", ENCODING_PACKED)]


def test_a_phones_batch_becomes_a_payload_of_its_tag() -> None:
    bench = make_api_bench()
    response = post(bench, f"{PHONE}?tag=anna", BATCH)
    assert response.status_code == 200
    assert PhoneReadingsReceived.model_validate(response.json()).samples == 1
    [(tag, payload, encoding)] = bench.received
    assert (tag, encoding) == ("anna", ENCODING_PACKED)
    frame = decode_packed(payload)
    assert isinstance(frame, Frame)
    assert [sample.t_ns for sample in frame.imu] == [T_NS]


def test_what_a_phone_cannot_be_used_for_is_told_with_the_status_that_its_app_shows() -> None:
    bench = make_api_bench()
    upright = [
        reading("gyroscope", T_NS, (0, 0, 0)),
        reading("accelerometer", T_NS, (0, 0, 0)),
        reading("gravity", T_NS, (0, -G, 0)),
    ]
    for body, sentence in ((b"hello", "is not JSON"), (message(0, upright), TILTED)):
        response = post(bench, f"{PHONE}?tag=anna", body)
        assert response.status_code == 499
        assert response.headers["content-type"].startswith("text/plain")
        assert sentence in response.text
    ios = post(bench, f"{PHONE}?tag=anna&signs=ios", message(0, upright, session="another"))
    assert PhoneReadingsReceived.model_validate(ios.json()).samples == 1


@pytest.mark.parametrize("value", [math.nan, math.inf, None, "NaN"])
def test_a_phone_whose_sensor_gives_no_numbers_is_told_so_and_not_to_switch_it_on(value: Any) -> None:
    readings = [reading("totalacceleration", T_NS, (0, 0, G)), reading("gyroscope", T_NS, (value, 0, 0))]
    response = post(make_api_bench(), f"{PHONE}?tag=anna", message(0, readings))
    assert response.status_code == 499
    assert response.text.startswith("The readings of Gyroscope are not numbers: start the recording again.")


def test_a_tags_key_speaks_for_its_own_tag_and_for_nobody_else(guarded: Guarded) -> None:
    assert guarded.post(PHONE, guarded.anna).status_code == 200
    assert guarded.post(f"{SAMPLES}?tag=anna", guarded.anna, encode_json(FRAME)).json()["reason"] == "encoding_unknown"
    for path in (SAMPLES, PHONE):
        response = guarded.post(f"{path}?tag=bert", guarded.anna)
        assert kind_of(response) == "forbidden"
        assert "'anna' only" in response.json()["detail"]
    assert {tag for tag, _, _ in guarded.bench.received} == {"anna"}


def test_a_tags_key_reads_nothing_and_other_keys_send_nothing(guarded: Guarded) -> None:
    headers = {"authorization": f"Bearer {guarded.anna}"}
    for path in ("/api/v1/poses", "/api/v1/tags/anna", "/metrics"):
        assert kind_of(ask(guarded.app, "GET", path, headers=headers)) == "forbidden"
    for path in (f"{SAMPLES}?tag=anna", f"{PHONE}?tag=anna"):
        refused = guarded.post(path, guarded.writer)
        assert kind_of(refused) == "forbidden"
        assert "--tag TAG" in refused.json()["detail"]
    assert guarded.bench.received == []


def test_the_key_in_the_url_works_for_sensor_logger_alone_and_is_repeated_nowhere(guarded: Guarded) -> None:
    assert ask(guarded.app, "POST", f"{PHONE}?token={guarded.anna}", content=BATCH).status_code == 200
    for path in (SAMPLES, "/api/v1/poses"):
        response = ask(guarded.app, "POST", f"{path}?token={guarded.anna}", content=BATCH)
        assert kind_of(response) == "unauthenticated"
        assert guarded.anna not in response.text
    wrong = guarded.anna[:-2] + "xx"
    for query in (f"token={wrong}", f"token={guarded.anna}&tag=bert", f"token={guarded.anna}&signs=up"):
        response = ask(guarded.app, "POST", f"{PHONE}?{query}", content=BATCH)
        assert response.status_code in (401, 403, 422)
        assert wrong not in response.text
        assert guarded.anna not in response.text


def test_a_wrong_key_is_told_in_a_sentence(guarded: Guarded) -> None:
    response = ask(guarded.app, "POST", f"{PHONE}?token=wrong", content=BATCH)
    assert kind_of(response) == "unauthenticated"
    assert response.json()["detail"].startswith("Authentication failed: ")


def test_one_key_has_its_own_rate_and_bodies_have_an_end(tmp_path: Path) -> None:
    guarded = Guarded(tmp_path, RateLimiter(per_s=1.0, burst=2, clock=lambda: 0.0))
    statuses = [guarded.post(PHONE, guarded.anna).status_code for _ in range(3)]
    assert statuses == [200, 200, 429]
    large = post(make_api_bench(), f"{PHONE}?tag=a", b" " * (MAX_BODY_BYTES + 1))
    assert kind_of(large) == "body-too-large"


def test_a_key_for_a_tag_is_kept_with_the_tag_and_an_id_that_is_none_is_refused(tmp_path: Path) -> None:
    secret = ApiKeys(tmp_path).add_for_tag("phone", "anna", days=1)
    identity = ApiKeys(tmp_path).identify(secret)
    assert (identity.tag, identity.scope) == ("anna", None)
    assert secret not in json.dumps([key.model_dump(mode="json") for key in ApiKeys(tmp_path).all().values()])
    for tag in ("", "x" * 65, "all*"):
        with pytest.raises(ApiKeyError):
            ApiKeys(tmp_path).add_for_tag("other", tag)
