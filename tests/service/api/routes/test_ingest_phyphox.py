"""The app phyphox: the experiment that it loads, the code that it scans, and what it posts with them."""

import json
from pathlib import Path
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree

import httpx
import pytest

from dropanchor_schemas.answers import PhoneReadingsReceived
from dropanchor_schemas.wire import ENCODING_JSON, ENCODING_PACKED
from dropanchor_service.phones.phyphox import parse
from service.api.routes.test_ingest import Guarded
from support.api import ask, kind_of, make_api_bench
from support.phyphox import event, message, recording
from support.sensor_logger import G

PHYPHOX = "/api/v1/ingest/phyphox"
[BATCH] = recording(0.2, {"gyroscope": lambda _: (0, 0, 0), "accelerometer": lambda _: (0, 0, G)}, 1_800_000_000.0)


class Asking(Guarded):
    """The same with requests of any kind."""

    def ask(self, method: str, path: str, secret: str = "", content: bytes = b"") -> httpx.Response:
        headers = {"authorization": f"Bearer {secret}"} if secret else {}
        return ask(self.app, method, path, headers=headers, content=content)


@pytest.fixture
def guarded(tmp_path: Path) -> Asking:
    return Asking(tmp_path)


def connection_of(content: bytes) -> ElementTree.Element:
    connection = ElementTree.fromstring(content).find("network/connection")
    assert connection is not None
    return connection


def test_what_the_experiment_sends_where_it_says_becomes_samples(guarded: Asking) -> None:
    response = guarded.ask("GET", f"{PHYPHOX}?token={guarded.anna}")
    assert (response.status_code, response.headers["cache-control"]) == (200, "no-store")
    address = urlsplit(connection_of(response.content).attrib["address"])
    assert (address.scheme, address.netloc) == ("http", "test")
    posted = guarded.ask("POST", f"{address.path}?{address.query}", content=BATCH)
    assert PhoneReadingsReceived.model_validate(posted.json()).samples == 19
    assert [(tag, encoding) for tag, _, encoding in guarded.bench.received] == [("anna", ENCODING_PACKED)]


def test_every_buffer_of_the_experiment_is_filled_sent_once_and_understood() -> None:
    content = ask(make_api_bench().app(), "GET", f"{PHYPHOX}?tag=anna").content
    root = ElementTree.fromstring(content)
    assert root.attrib["version"] == "1.14"
    containers = {container.text for container in root.iterfind("data-containers/container")}
    filled = {output.text for output in root.iterfind("input/sensor/output")}
    connection = connection_of(content)
    sent = [send for send in connection.iterfind("send") if send.get("type") != "time"]
    received = {receive.text for receive in connection.iterfind("receive")}
    assert filled == {send.text for send in sent} == containers - received
    assert all(send.get("keep") == "false" and send.get("id") == send.text for send in sent)
    assert [send.get("id") for send in connection.iterfind("send") if send.get("type") == "time"] == ["time"]
    columns = {str(send.get("id")): [0.01] for send in sent}
    events = [{"event": "START", "experimentTime": 0.0, "systemTime": 1.8e9}]
    understood = parse(json.dumps({"time": {"now": 1.8e9, "events": events}} | columns).encode())
    assert understood is not None
    assert {name: len(stream) for name, stream in understood.streams.items()} == {
        "totalacceleration": 1,
        "gyroscope": 1,
        "magnetometer": 1,
    }
    assert [one.pressure_pa for one in understood.pressures] == [1.0]


def test_a_tag_whose_name_needs_escapes_gets_an_experiment_that_can_be_read() -> None:
    bench = make_api_bench()
    content = ask(bench.app(), "GET", f"{PHYPHOX}?tag=%3Cb%3E%20%26%20%22").content
    address = urlsplit(connection_of(content).attrib["address"])
    assert parse_qs(address.query)["tag"] == ['<b> & "']
    assert ElementTree.fromstring(content).findtext("title") == 'Tag <b> & "'


def test_the_code_is_an_image_for_the_key_that_asks(guarded: Asking) -> None:
    response = guarded.ask("GET", f"{PHYPHOX}/code?tag=anna", guarded.anna)
    assert response.headers["content-type"].startswith("image/svg+xml")
    assert ElementTree.fromstring(response.content).tag.endswith("svg")
    assert kind_of(guarded.ask("GET", f"{PHYPHOX}/code?token={guarded.anna}")) == "unauthenticated"


@pytest.mark.parametrize(("method", "path"), [("GET", PHYPHOX), ("GET", f"{PHYPHOX}/code"), ("POST", PHYPHOX)])
def test_a_key_is_needed_and_speaks_for_its_own_tag_only(guarded: Asking, method: str, path: str) -> None:
    assert kind_of(guarded.ask(method, path)) == "unauthenticated"
    assert kind_of(guarded.ask(method, f"{path}?tag=bert", guarded.anna)) == "forbidden"
    assert kind_of(guarded.ask(method, path, guarded.writer)) == "forbidden"
    assert guarded.bench.received == []


@pytest.mark.parametrize(
    ("body", "sentence", "reason"),
    [(b"hello", "is not JSON", "json_syntax"), (message([], 1.8e9, {"gyroscope": [(0, (0, 0, 0))]}), "no start", None)],
)
def test_what_is_no_message_is_answered_with_a_sentence_and_counted(
    body: bytes, sentence: str, reason: str | None
) -> None:
    bench = make_api_bench()
    response = ask(bench.app(), "POST", f"{PHYPHOX}?tag=anna", content=body)
    assert (response.status_code, kind_of(response)) == (422, "samples-rejected")
    assert sentence in response.json()["detail"]
    assert response.json()["reason"] == (reason or "json_schema")
    assert bench.received == [("anna", body, ENCODING_JSON)]


def test_a_phone_whose_clock_was_never_set_is_told() -> None:
    bench, events = make_api_bench(), [event("START", 0.0, 10_000.0)]
    readings = {name: [(t, (0.0, 0.0, 1.0)) for t in (0.01, 0.02)] for name in ("gyroscope", "accelerometer")}
    response = ask(bench.app(), "POST", f"{PHYPHOX}?tag=anna", content=message(events, 10_001.0, readings))
    assert (response.status_code, response.json()["reason"]) == (422, "time_not_utc")
    assert "counts from a start" in response.json()["detail"]
    assert [encoding for _, _, encoding in bench.received] == [ENCODING_PACKED]
