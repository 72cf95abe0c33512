"""Events reach a real mail server: as plain sentences, many in one mail, through outages and refusals."""

import gc
import re
import ssl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from aiosmtpd.smtp import SMTP, Envelope, Session
from pydantic import ValidationError

from dropanchor_schemas.destinations import EmailDestination, Language
from dropanchor_schemas.site import Site
from dropanchor_service.delivery import queue
from dropanchor_service.settings.events import EmailSettings
from service.delivery.names import resolve_to_loopback
from support.certificate import self_signed
from support.delivery import LOOPBACK, DeliveryBench
from support.mail_server import MailServer, running_mail_server
from support.zenoh_router import wait_until


@pytest.fixture(autouse=True)
def _fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queue, "FIRST_RETRY_S", 0.05)


def bench_of(server: MailServer, tls: str = "none", host: str = "127.0.0.1", **settings: Any) -> DeliveryBench:
    login = {name: settings.pop(name) for name in ("user", "password_file") if name in settings}
    email = EmailSettings.model_validate(
        {"server": host, "port": server.port, "tls": tls, "sender": "yard@example.com"} | login
    )
    return DeliveryBench(email=email, **settings)


@contextmanager
def delivering(
    bench: DeliveryBench,
    digest_s: float = 0.0,
    to: tuple[str, ...] = ("shift@example.com",),
    language: Language = Language.ENGLISH,
) -> Iterator[None]:
    bench.put(EmailDestination(type="email", id="mes", to=list(to), digest_s=digest_s, language=language))
    with bench.thread:
        yield


def server_context(folder: Path) -> tuple[ssl.SSLContext, Path]:
    certificate, key = self_signed(folder)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    return context, certificate


def test_a_mail_says_who_did_what_where_and_when_and_links_to_the_moment() -> None:
    server = MailServer()
    bench = bench_of(server, page="https://yard.example.com/", name_of=lambda tag: f"Cart ({tag})")
    bench.live.answers.site.set_site(Site(id="yard", time_zone="Asia/Kolkata"))
    with running_mail_server(server), delivering(bench):
        bench.happen("cart-3")
        wait_until(lambda: bench.counts() == (0, 0))
    (mail,) = server.mails
    assert (mail["From"], mail["To"]) == ("yard@example.com", "shift@example.com")
    assert mail["Subject"] == "[yard] Cart (cart-3) entered Loading dock"
    assert mail["Auto-Submitted"] == "auto-generated"
    said, where, link = mail.get_content().splitlines()[:3]
    assert said == "Cart (cart-3) entered Loading dock."
    assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d IST; ", where)
    assert where.endswith("x 3.2 m, y 1.7 m; probability 0.99; event 1")
    assert link.startswith("https://yard.example.com/#from=20")
    assert link.endswith("&tag=cart-3")


def test_a_mail_is_in_the_language_of_its_destination() -> None:
    server = MailServer()
    bench = bench_of(server)
    with running_mail_server(server), delivering(bench, digest_s=1.0, language=Language.GERMAN):
        bench.happen("cart-3")
        wait_until(lambda: len(server.mails) == 1)
        bench.happen(*(f"cart-{number}" for number in range(30)))
        wait_until(lambda: bench.counts() == (0, 0))
    first, digest = server.mails
    assert first["Subject"] == "[yard] cart-3 hat Loading dock betreten"
    said, where = first.get_content().splitlines()[:2]
    assert said == "cart-3 hat Loading dock betreten."
    assert where.endswith("x 3,2 m, y 1,7 m; Wahrscheinlichkeit 0,99; Ereignis 1")
    assert digest["Subject"] == "[yard] cart-0 hat Loading dock betreten, und 29 weitere Ereignisse"
    assert digest.get_content().splitlines()[:2] == ["30 Ereignisse:", "30 x Zone betreten: Loading dock"]


def test_events_that_happen_within_the_pause_become_one_mail() -> None:
    server = MailServer()
    bench = bench_of(server)
    with running_mail_server(server), delivering(bench, digest_s=3.0):
        bench.happen("first")
        wait_until(lambda: len(server.mails) == 1)
        bench.happen(*(f"cart-{number}" for number in range(20)))
        bench.happen(*(f"cart-{number}" for number in range(20, 30)))
        wait_until(lambda: bench.counts() == (0, 0))
    first, digest = server.mails
    assert server.arrived_s[1] - server.arrived_s[0] > 2.9
    assert first["Subject"] == "[yard] first entered Loading dock"
    assert digest["Subject"] == "[yard] cart-0 entered Loading dock, and 29 more events"
    lines = digest.get_content().splitlines()
    assert lines[:2] == ["30 events:", "30 x Entered a zone: Loading dock"]
    assert [line for line in lines if line.endswith("dock.")] == [
        f"cart-{number} entered Loading dock." for number in range(30)
    ]


@pytest.mark.parametrize("answer", ["451 try again later", "421 closing"])
def test_an_unavailable_server_gets_everything_later_in_one_mail(answer: str) -> None:
    server = MailServer(answer=answer)
    bench = bench_of(server)
    with running_mail_server(server), delivering(bench):
        bench.happen("a", "b", "a")
        wait_until(lambda: server.attempts >= 3)
        assert bench.counts() == (3, 0)
        assert answer[:3] in (bench.thread.problem_of(0, "mes") or "")
        server.answer = "250 OK"
        wait_until(lambda: bench.counts() == (0, 0) and bench.thread.problem_of(0, "mes") is None)
    assert [line for line in server.text().splitlines() if line.endswith("dock.")] == [
        f"{tag} entered Loading dock." for tag in "aba"
    ]


def test_events_wait_while_there_is_no_server() -> None:
    server = MailServer()
    bench = bench_of(server)
    with delivering(bench):
        bench.happen("a")
        wait_until(lambda: "the mail server cannot be used" in (bench.thread.problem_of(0, "mes") or ""))
        with running_mail_server(server):
            wait_until(lambda: bench.counts() == (0, 0))
    assert len(server.mails) == 1


def test_a_server_whose_name_stands_for_an_address_inside_gets_nothing_unless_the_settings_allow_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    resolve_to_loopback(monkeypatch, "mail.example.com")
    server = MailServer()
    with running_mail_server(server):
        bench = bench_of(server, host="mail.example.com", allow_networks=())
        with delivering(bench):
            bench.happen("a")
            wait_until(
                lambda: "127.0.0.1, which is the machine of the service" in (bench.thread.problem_of(0, "mes") or "")
            )
        assert server.mails == []
        for host, networks in (("localhost", ()), ("mail.example.com", LOOPBACK)):
            bench = bench_of(server, host=host, allow_networks=networks)
            with delivering(bench):
                bench.happen("a")
                wait_until(lambda bench=bench: bench.counts() == (0, 0))  # type: ignore[misc]
    assert len(server.mails) == 2


def test_a_mail_that_the_server_refuses_becomes_dead_letters_that_can_be_sent_again() -> None:
    server = MailServer(refused={"shift@example.com": "550 no such user"})
    bench = bench_of(server)
    with running_mail_server(server), delivering(bench):
        bench.happen("a", "b")
        wait_until(lambda: bench.counts() == (0, 2))
        reasons = {reason for _, reason in bench.deliveries.dead("mes")}
        assert reasons == {"the mail server answered 550 shift@example.com: no such user"}
        server.refused.clear()
        bench.deliveries.retry("mes", time.time_ns())
        wait_until(lambda: bench.counts() == (0, 0))
    assert len(server.mails) == 1


def test_a_recipient_that_is_refused_is_a_problem_although_the_others_get_the_mail() -> None:
    server = MailServer(refused={"gone@example.com": "550 no such user"})
    bench = bench_of(server)
    with running_mail_server(server), delivering(bench, to=("gone@example.com", "shift@example.com")):
        bench.happen("a")
        wait_until(lambda: bench.counts() == (0, 0))
        wait_until(lambda: "gone@example.com was refused" in (bench.thread.problem_of(0, "mes") or ""))
    assert len(server.mails) == 1


@pytest.mark.filterwarnings("ignore:Requiring AUTH:UserWarning")  # the server does not see TLS from the first byte
@pytest.mark.filterwarnings("ignore:Session.login_data is deprecated:DeprecationWarning")
@pytest.mark.parametrize("tls", ["tls", "starttls"])
def test_mails_leave_encrypted_with_the_password_in_the_file(tls: str, tmp_path: Path) -> None:
    server = MailServer(login=("yard", "right"))
    context, authority = server_context(tmp_path)
    password = tmp_path / "password"
    password.write_text("wrong\n")
    bench = bench_of(server, tls, authorities=authority, user="yard", password_file=password)
    with running_mail_server(server, **{tls: context}), delivering(bench):
        bench.happen("a")
        wait_until(lambda: "refuses the login" in (bench.thread.problem_of(0, "mes") or ""))
        password.write_text("right\n")
        wait_until(lambda: bench.counts() == (0, 0))
    assert server.was_encrypted == [True]


@pytest.mark.parametrize("tls", ["tls", "starttls"])
def test_a_server_that_is_slow_to_end_a_connection_leaves_none_open(tls: str, tmp_path: Path) -> None:
    class Slow(MailServer):
        async def handle_QUIT(self, server: SMTP, _session: Session, _envelope: Envelope) -> str:  # noqa: N802
            await server.push("221 Bye")
            time.sleep(0.5)  # with its loop, so that it does not even see that the client has gone
            return "221 Bye"

    server = Slow()
    context, authority = server_context(tmp_path)
    bench = bench_of(server, tls, authorities=authority)
    with running_mail_server(server, **{tls: context}), delivering(bench):
        bench.happen("a")
        wait_until(lambda: bench.counts() == (0, 0))
    gc.collect()  # warns of a transport that nobody closed
    assert len(server.mails) == 1


@pytest.mark.parametrize("tls", ["tls", "starttls"])
def test_a_server_whose_certificate_is_not_trusted_gets_nothing(tls: str, tmp_path: Path) -> None:
    server = MailServer()
    context, _ = server_context(tmp_path)
    bench = bench_of(server, tls)
    with running_mail_server(server, **{tls: context}), delivering(bench):
        bench.happen("a")
        wait_until(lambda: "certificate" in (bench.thread.problem_of(0, "mes") or "").lower())
        assert bench.counts() == (1, 0)
    assert server.attempts == 0


def test_a_server_without_tls_gets_nothing_when_tls_is_wanted() -> None:
    server = MailServer()
    bench = bench_of(server, "starttls")
    with running_mail_server(server), delivering(bench):
        bench.happen("a")
        wait_until(lambda: "STARTTLS" in (bench.thread.problem_of(0, "mes") or ""))
    assert server.attempts == 0


def test_a_password_is_never_sent_in_the_clear(tmp_path: Path) -> None:
    with pytest.raises(ValidationError, match="could be read on the way"):
        EmailSettings(server="mail", tls="none", user="yard", password_file=tmp_path / "password")
    with pytest.raises(ValidationError, match="belong together"):
        EmailSettings(server="mail", user="yard")


def test_the_same_events_make_the_same_message_id_after_a_restart(tmp_path: Path) -> None:
    server = MailServer()
    (tmp_path / "one").mkdir()
    bench = bench_of(server, folder=tmp_path)
    with running_mail_server(server):
        with delivering(bench):
            bench.happen("a", "b")
            wait_until(lambda: bench.counts() == (0, 0))
        bench.deliveries.bury("mes", [1, 2], "as if the answer had not come")
        with bench.store.database.transaction() as connection:
            connection.executemany("INSERT INTO deliveries VALUES ('mes', ?, 0, NULL, NULL)", [(1,), (2,)])
        bench.store.database.close()
        again = bench_of(server, folder=tmp_path)
        with again.thread:
            wait_until(lambda: again.counts() == (0, 0))
        again.store.database.close()
    first, second = server.mails
    assert first["Message-ID"] == second["Message-ID"]
