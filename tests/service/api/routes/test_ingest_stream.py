"""Samples over a WebSocket: who may send them, what is acknowledged, and what is passed on."""

import json
import logging
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from dropanchor_schemas.answers import SamplesAcknowledged
from dropanchor_schemas.wire import (
    ENCODING_JSON,
    ENCODING_PACKED,
    MAX_PAYLOAD_BYTES,
    Frame,
    RangeSample,
    encode_json,
    encode_packed,
)
from dropanchor_service.api.http.limits import GuardedProtocol
from dropanchor_service.api.http.rates import RateLimiter
from dropanchor_service.api.routes.ingest_stream import CONNECTIONS_PER_KEY, KEY_PROTOCOL, PROTOCOL
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from support.api import T_NS, ApiBench, make_api_bench
from support.http_server import running_server
from support.interface_document import SCHEMAS
from support.patience import PATIENCE_S

FRAME = Frame(ranges=[RangeSample(T_NS, 17, 12.5), RangeSample(T_NS + 1000, 17, 12.75)], sequence=3, boot_id=9)
JSON = encode_json(FRAME).decode()


class Place:
    """A running service with the key of the tag anna and one that may change things. now_s: the clock of the keys."""

    def __init__(self, folder: Path) -> None:
        self.now_s = 0.0
        self.keys = ApiKeys(folder, lambda: self.now_s)
        self.anna, self.writer = self.keys.add_for_tag("anna's phone", "anna"), self.keys.add("writer", Scope.WRITE)
        self.bench: ApiBench = make_api_bench()
        self.port = 0

    @contextmanager
    def running(self, keys: bool = True, rate_limiter: RateLimiter | None = None) -> Iterator["Place"]:
        authenticator = Authenticator({SOURCE: self.keys}) if keys else None
        app = self.bench.app(authenticator=authenticator, rate_limiter=rate_limiter)
        with running_server(app, self.bench.stopping) as self.port:
            yield self

    def connect(self, secret: str = "", query: str = "", **options: Any) -> ClientConnection:
        headers = {"authorization": f"Bearer {secret}"} if secret else {}
        url = f"ws://127.0.0.1:{self.port}/api/v1/ingest/stream{query}"
        connection: ClientConnection = connect(url, additional_headers=headers, proxy=None, **options)
        return connection

    def refusal(self, secret: str = "", query: str = "", **options: Any) -> tuple[int, str]:
        """Return the code and the sentence with which a connection is ended."""
        with self.connect(secret, query, **options) as socket:
            return end_of(socket)


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path)


def end_of(socket: ClientConnection) -> tuple[int, str]:
    """Return the code and the sentence with which the service ends a connection. It must not answer before."""
    with pytest.raises(ConnectionClosed) as closed:
        socket.recv(PATIENCE_S)
    assert closed.value.rcvd is not None
    return closed.value.rcvd.code, closed.value.rcvd.reason


def answer(socket: ClientConnection) -> SamplesAcknowledged:
    return SamplesAcknowledged.model_validate_json(socket.recv(PATIENCE_S))


def test_every_message_is_passed_on_as_it_is_and_acknowledged_in_order(place: Place) -> None:
    packed = encode_packed(FRAME)
    with place.running(), place.connect(place.anna) as socket:
        greeting = answer(socket)
        socket.send(JSON)
        socket.send(packed)
        socket.send([packed[:20], packed[20:]])
        answers = [answer(socket) for _ in range(3)]
    assert (greeting.message, greeting.samples, greeting.tag, greeting.state) == (0, 0, "anna", None)
    assert [(a.message, a.samples, a.rejected) for a in answers] == [(1, 2, None), (2, 2, None), (3, 2, None)]
    assert place.bench.received == [
        ("anna", JSON.encode(), ENCODING_JSON),
        ("anna", packed, ENCODING_PACKED),
        ("anna", packed, ENCODING_PACKED),
    ]


def test_a_payload_that_cannot_be_decoded_is_passed_on_to_be_counted_and_the_answer_says_why(place: Place) -> None:
    with place.running(), place.connect(place.anna) as socket:
        answer(socket)
        for payload in ("{", "{}", b"", b"\x07", b"\0" * (MAX_PAYLOAD_BYTES + 1)):
            socket.send(payload)
        rejected = [answer(socket) for _ in range(5)]
        socket.send(JSON)
        assert answer(socket).samples == 2
    assert [a.rejected for a in rejected] == [
        "json_syntax",
        "no_samples",
        "payload_empty",
        "version_unknown",
        "payload_too_large",
    ]
    assert all(a.samples == 0 and a.detail for a in rejected)
    assert len(place.bench.received) == 6


def test_a_time_that_cannot_be_utc_is_acknowledged_with_what_it_looks_like(place: Place) -> None:
    early = Frame(ranges=[RangeSample(T_NS // 10**6, 17, 12.5)], sequence=0, boot_id=9)
    with place.running(), place.connect(place.anna) as socket:
        answer(socket)
        for payload in (encode_json(early).decode(), encode_packed(early)):
            socket.send(payload)
            acknowledged = answer(socket)
            assert (acknowledged.samples, acknowledged.rejected) == (0, "time_not_utc")
            assert "looks like milliseconds" in acknowledged.detail
    assert len(place.bench.received) == 2


def test_a_message_of_more_than_a_mebibyte_ends_the_connection(place: Place) -> None:
    with place.running(), place.connect(place.anna) as socket:
        answer(socket)
        socket.send(b"\0" * (2**20 + 1))
        assert end_of(socket)[0] == 1009
    assert place.bench.received == []


def test_the_answer_tells_the_state_of_the_tag_and_the_time_of_the_service(place: Place) -> None:
    place.bench.move("anna")
    with place.running(), place.connect(place.anna) as first, place.connect(place.anna) as second:
        greeting = answer(first)
        assert answer(second).started_ns == greeting.started_ns
    assert (greeting.state, greeting.t_ns) == ("tracking", T_NS)


def test_a_browser_offers_its_key_as_a_protocol(place: Place) -> None:
    with place.running(), place.connect(subprotocols=[PROTOCOL, f"{KEY_PROTOCOL}{place.anna}"]) as socket:
        assert answer(socket).tag == "anna"
        assert socket.subprotocol == PROTOCOL


def test_a_key_opens_only_its_own_tag_and_every_refusal_is_a_sentence(place: Place) -> None:
    with place.running():
        make = "Make a key with dropanchor key add NAME --tag TAG."
        assert place.refusal() == (4401, f"This service needs a key. {make}")
        assert place.refusal("dropanchor_no") == (4401, "Not accepted: the API key is unknown or was revoked.")
        assert place.refusal(place.writer) == (4403, f"This key may not send samples. {make}")
        assert place.refusal(place.anna, "?tag=bert") == (4403, "This key speaks for the tag 'anna' only.")
    assert place.bench.received == []


def test_without_credentials_the_url_names_the_tag_and_pages_of_other_origins_are_refused(place: Place) -> None:
    with place.running(keys=False):
        assert place.refusal() == (4400, "Say which tag this is: add ?tag=NAME to the URL.")
        for named in ("a" * 100, "..", "%2E%2E", "."):
            assert place.refusal(query=f"?tag={named}")[0] == 4400
        assert place.refusal(query="?tag=bert", origin="http://evil.example")[0] == 4403
        own = f"http://127.0.0.1:{place.port}"
        with place.connect(query="?tag=bert", origin=own) as socket:
            assert answer(socket).tag == "bert"


def test_a_revoked_key_ends_the_connection_before_the_next_message_is_taken(place: Place) -> None:
    with place.running(), place.connect(place.anna) as socket:
        answer(socket)
        place.keys.revoke("anna's phone")
        place.now_s = 5.0
        socket.send(JSON)
        assert end_of(socket)[0] == 4401
    assert place.bench.received == []


def test_a_stopping_service_takes_and_acknowledges_nothing_more(place: Place) -> None:
    with place.running(), place.connect(place.anna) as socket:
        answer(socket)
        place.bench.stopping.set()
        socket.send(JSON)
        assert end_of(socket)[0] == 1012
    assert place.bench.received == []


def test_a_key_has_a_limited_number_of_connections(place: Place) -> None:
    with place.running(), ExitStack() as opened:
        for _ in range(CONNECTIONS_PER_KEY):
            answer(opened.enter_context(place.connect(place.anna)))
        assert place.refusal(place.anna)[0] == 4429
        opened.close()
        with place.connect(place.anna) as socket:
            assert answer(socket).message == 0


def test_a_client_that_is_too_fast_is_slowed_down_and_loses_nothing(place: Place) -> None:
    now_s = 0.0

    def clock() -> float:
        nonlocal now_s
        now_s += 0.001
        return now_s

    with (
        place.running(rate_limiter=RateLimiter(per_s=100.0, burst=2, clock=clock)),
        place.connect(place.anna) as socket,
    ):
        answer(socket)
        for _ in range(20):
            socket.send(JSON)
        assert [answer(socket).message for _ in range(20)] == list(range(1, 21))
    assert len(place.bench.received) == 20
    assert now_s > 0.15


class _Impatient(GuardedProtocol):
    request_s = 1.0  # in which the handshake must come


def test_a_connection_is_not_a_request_that_never_completes(place: Place) -> None:
    bench = place.bench
    with (
        running_server(bench.app(), bench.stopping, protocol=_Impatient) as place.port,
        place.connect(query="?tag=anna") as socket,
    ):
        answer(socket)
        time.sleep(1.5 * _Impatient.request_s)
        socket.send(JSON)
        assert answer(socket).samples == 2


def test_the_key_never_gets_into_the_log(place: Place, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    with place.running():
        with place.connect(subprotocols=[PROTOCOL, f"{KEY_PROTOCOL}{place.anna}"], logger=logging.Logger("client")):
            pass
        place.refusal(query=f"?token={place.anna}", logger=logging.Logger("client"))
    assert place.anna not in caplog.text


def test_no_other_path_takes_a_web_socket(place: Place) -> None:
    with place.running(), pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{place.port}/", proxy=None)
    assert refused.value.response.status_code == 403


def test_the_answer_is_in_the_interface_document(place: Place) -> None:
    assert set(SCHEMAS["SamplesAcknowledged"]["properties"]) == set(json.loads(_greeting(place)))


def _greeting(place: Place) -> str:
    with place.running(), place.connect(place.anna) as socket:
        return str(socket.recv(PATIENCE_S))
