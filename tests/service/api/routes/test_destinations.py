"""Destinations over REST: made, tested, and what could not be delivered."""

import ipaddress
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest

from dropanchor_service.api.http.permissions import Need, need_of
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.delivery.registry import FILE_NAME, WEBHOOKS_FILE_NAME, open_destinations
from dropanchor_service.delivery.write_only import shown_url
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings
from service.api.routes.test_zones_and_events import app_of, happen
from support.api import ask, kind_of
from support.mail_server import MailServer, running_mail_server
from support.receiver import Receiver, running_receiver

SECRET = examples.SECRET
MES = "/api/v1/destinations/mes"


def webhook(**changes: Any) -> dict[str, Any]:
    return {"id": "mes", "type": "webhook", "url": "http://127.0.0.1:9/", "secret": SECRET} | changes


def with_loopback(
    folder: Path | None = None, email: EmailSettings | None = None, mqtt: MqttSettings | None = None
) -> EventParts:
    delivery = DeliverySettings(allow_networks=(ipaddress.ip_network("127.0.0.0/8"),), timeout_s=60.0)
    channels = Channels(delivery, email or EmailSettings(), mqtt or MqttSettings())
    return replace(EventParts.in_memory("yard"), channels=channels, destinations=open_destinations(folder))


def test_a_webhook_never_returns_its_secret_and_keeps_it(tmp_path: Path) -> None:
    parts = with_loopback(tmp_path)
    app = app_of(parts)
    made = ask(app, "PUT", MES, json=webhook())
    assert made.json()["has_secret"] is True
    changed = ask(app, "PUT", MES, json=made.json()["destination"] | {"tags": ["a"]})
    answers = [made, changed, *(ask(app, "GET", path) for path in ("/api/v1/destinations", MES))]
    assert all(response.status_code == 200 and SECRET not in response.text for response in answers)
    kept = open_destinations(tmp_path).all["mes"].model_dump()
    assert (kept["secret"], kept["tags"]) == (SECRET, ["a"])
    assert (tmp_path / FILE_NAME).stat().st_mode & 0o077 == 0


def test_the_list_says_what_the_settings_lack_before_anybody_fills_a_form() -> None:
    lacking = ask(app_of(with_loopback()), "GET", "/api/v1/destinations").json()["unavailable"]
    assert lacking == {
        "email": "an e-mail needs a mail server: set `server` in `[email]` of the settings.",
        "mqtt": "MQTT needs a broker: set `server` in `[mqtt]` of the settings.",
        "mqtt_poses": "MQTT needs a broker: set `server` in `[mqtt]` of the settings.",
    }


URL = "http://127.0.0.1:9/services/T0/xoxb-token?key=abc"


def test_a_webhook_never_returns_its_url_after_the_host_and_keeps_it(tmp_path: Path) -> None:
    parts = with_loopback(tmp_path)
    app = app_of(parts)
    made = ask(app, "PUT", MES, json=webhook(url=URL))
    assert made.json()["destination"]["url"] == "http://127.0.0.1:9/…"
    changed = ask(app, "PUT", MES, json=made.json()["destination"] | {"enabled": False})
    answers = [made, changed, *(ask(app, "GET", path) for path in ("/api/v1/destinations", MES, f"{MES}/dead-letters"))]
    assert all(answer.status_code == 200 and "xoxb" not in answer.text for answer in answers)
    kept = open_destinations(tmp_path).all["mes"].model_dump()
    assert (kept["url"], kept["enabled"]) == (URL, False)
    for moved in ("http://127.0.0.9:9/…", "http://127.0.0.1:10/…", "http://127.0.0.1:9/…/events"):
        response = ask(app, "PUT", MES, json=made.json()["destination"] | {"url": moved})
        assert "give the whole URL" in response.json()["detail"]
    assert kind_of(ask(app, "PUT", f"{MES}2", json=webhook(id="mes2", url="http://127.0.0.1:9/…"))) == (
        "destination-refused"
    )


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("https://mes.example", "https://mes.example"),
        ("https://mes.example:8443/", "https://mes.example:8443/"),
        ("https://mes.example?token=1", "https://mes.example/…"),
        ("https://mes.example/#1", "https://mes.example/…"),
        ("https://me:word@mes.example/", "https://mes.example/…"),
    ],
)
def test_a_url_is_shown_up_to_its_host(url: str, expected: str) -> None:
    assert shown_url(url) == expected


def test_a_change_of_somebody_else_is_not_overwritten() -> None:
    app = app_of(with_loopback())
    etag = ask(app, "PUT", MES, json=webhook()).headers["etag"]
    assert ask(app, "GET", MES).headers["etag"] == etag
    assert ask(app, "PUT", MES, json=webhook(tags=["a"]), headers={"if-match": etag}).status_code == 200
    assert kind_of(ask(app, "PUT", MES, json=webhook(), headers={"if-match": etag})) == "changed-meanwhile"
    assert kind_of(ask(app, "DELETE", MES, headers={"if-match": etag})) == "changed-meanwhile"
    assert kind_of(ask(app, "PUT", MES, json=webhook(), headers={"if-none-match": "*"})) == "changed-meanwhile"


def test_webhooks_of_an_older_service_become_destinations(tmp_path: Path) -> None:
    older = {name: value for name, value in webhook(enabled=False).items() if name != "type"}
    (tmp_path / WEBHOOKS_FILE_NAME).write_bytes(orjson.dumps({"mes": older}))
    found = open_destinations(tmp_path).all["mes"]
    assert found.model_dump(exclude_defaults=True) == webhook(enabled=False)
    assert (tmp_path / FILE_NAME).stat().st_mode & 0o077 == 0


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (webhook(url="http://10.0.0.1/"), "allow_networks"),
        (webhook(url="http://169.254.169.254/"), "allow_networks"),
        (webhook(url="ftp://example.com/"), "https://"),
        (webhook(url="https://me:word@example.com/"), "password"),
        (webhook(secret=None), "needs a secret"),
        (webhook(secret="whsec_c2hvcnQ="), "(New secret)"),
        ({"id": "mes", "type": "email", "to": ["shift@example.com"]}, "`[email]`"),
        ({"id": "mes", "type": "mqtt"}, "`[mqtt]`"),
        ({"id": "mes", "type": "mqtt_poses"}, "`[mqtt]`"),
    ],
)
def test_a_destination_that_cannot_work_is_refused_with_a_sentence(body: Mapping[str, Any], words: str) -> None:
    response = ask(app_of(with_loopback()), "PUT", MES, json=body)
    assert kind_of(response) == "destination-refused"
    assert words in response.json()["detail"]
    assert SECRET not in response.text


@pytest.mark.parametrize(
    "change",
    [
        {"type": "email", "to": []},
        {"type": "email", "to": ["shift@example.com\r\nBcc: all@example.com"]},
        {"type": "mqtt", "topic": "yard/#"},
        {"type": "mqtt", "topic": "yard/{tag.__class__}"},
        {"type": "mqtt_poses", "prefix": "yard/#"},
        {"type": "mqtt_poses", "discovery": "/homeassistant"},
        {"type": "mqtt_poses", "types": ["dropanchor.zone.enter"]},
        {"type": "pigeon"},
    ],
)
def test_an_address_or_topic_that_is_none_is_not_valid(change: Mapping[str, Any]) -> None:
    response = ask(app_of(with_loopback()), "PUT", MES, json={"id": "mes", **change})
    assert kind_of(response) == "invalid-request"


def test_a_test_event_says_what_the_receiver_answered() -> None:
    app, receiver = app_of(with_loopback()), Receiver()
    with running_receiver(receiver):
        ask(app, "PUT", MES, json=webhook(url=receiver.url))
        tested = ask(app, "POST", f"{MES}/test").json()
    assert tested == {"delivered": True, "detail": "the receiver answered 200 OK"}
    assert receiver.accepted[0]["type"] == "dropanchor.destination.test"
    failed = ask(app, "POST", f"{MES}/test").json()
    assert failed["delivered"] is False
    assert "ConnectError" in failed["detail"]


def test_a_test_mail_says_which_recipient_the_server_refuses() -> None:
    server = MailServer(refused={"gone@example.com": "550 no such user"})
    email = EmailSettings(server="127.0.0.1", port=server.port, tls="none")
    app = app_of(with_loopback(email=email))
    with running_mail_server(server):
        to = ["shift@example.com", "gone@example.com"]
        ask(app, "PUT", MES, json={"id": "mes", "type": "email", "to": to})
        tested = ask(app, "POST", f"{MES}/test").json()
    assert tested == {"delivered": True, "detail": "gone@example.com was refused: 550 no such user"}
    assert "This is a test of the destination mes" in server.mails[0]["Subject"]


def test_a_destination_of_poses_gets_a_test_message_and_keeps_no_queue_of_its_former_type() -> None:
    parts = with_loopback(mqtt=MqttSettings(server="127.0.0.1", port=9, tls=False))
    app = app_of(parts)
    ask(app, "PUT", MES, json=webhook())
    with parts.store.database.transaction() as connection:
        connection.execute("INSERT INTO deliveries VALUES ('mes', 1, 0, NULL, NULL)")
    happen(parts, "a")
    assert ask(app, "GET", MES).json()["pending"] == 1
    made = ask(app, "PUT", MES, json={"id": "mes", "type": "mqtt_poses", "tags": ["a"]}).json()
    assert (made["pending"], made["destination"]["prefix"], made["has_secret"]) == (0, "dropanchor", False)
    happen(parts, "a")
    assert ask(app, "GET", MES).json()["pending"] == 0
    tested = ask(app, "POST", f"{MES}/test").json()
    assert tested["delivered"] is False
    assert "127.0.0.1:9 cannot be reached" in tested["detail"]


def test_dead_letters_are_listed_sent_again_dropped_and_go_with_their_destination() -> None:
    parts = with_loopback()
    app = app_of(parts)
    ask(app, "PUT", MES, json=webhook())
    with parts.store.database.transaction() as connection:
        rows = [(1, "refused"), (2, None), (3, "refused")]
        connection.executemany("INSERT INTO deliveries VALUES ('mes', ?, 0, ?, NULL)", rows)
    happen(parts, "a", "b", "c")
    state = ask(app, "GET", MES).json()
    assert (state["pending"], state["dead"], state["oldest_ns"]) == (1, 2, 5)
    letters = ask(app, "GET", f"{MES}/dead-letters").json()["dead_letters"]
    assert [(letter["event"]["subject"], letter["reason"]) for letter in letters] == [
        ("a", "refused"),
        ("c", "refused"),
    ]
    assert ask(app, "POST", f"{MES}/dead-letters/retry").json() == {"retried": 2}
    assert ask(app, "GET", MES).json()["pending"] == 3
    parts.deliveries.bury("mes", [2], "refused")
    assert ask(app, "DELETE", f"{MES}/dead-letters").status_code == 204
    assert ask(app, "GET", MES).json()["dead"] == 0
    assert len(parts.store.after(0, 9)) == 3
    assert ask(app, "DELETE", MES).status_code == 204
    assert parts.deliveries.states() == {}
    assert kind_of(ask(app, "POST", f"{MES}/test")) == "unknown-destination"


def test_only_an_administrator_changes_a_destination_and_no_share_link_reads_one() -> None:
    assert need_of("PUT", MES) is Need.ADMIN
    assert need_of("POST", f"{MES}/test") is Need.ADMIN
    assert need_of("POST", f"{MES}/dead-letters/retry") is Need.ADMIN
    for path in ("/api/v1/destinations", MES, f"{MES}/dead-letters", "/api/v1/sites/yard/destinations"):
        assert need_of("GET", path) is Need.READ
    assert need_of("PUT", "/api/v1/zones/dock") is Need.WRITE


def test_there_is_a_limit_of_destinations() -> None:
    app = app_of(with_loopback())
    for number in range(20):
        path = f"/api/v1/destinations/{number}"
        assert ask(app, "PUT", path, json=webhook(id=str(number))).status_code == 200
    assert kind_of(ask(app, "PUT", "/api/v1/destinations/more", json=webhook(id="more"))) == "items-full"
