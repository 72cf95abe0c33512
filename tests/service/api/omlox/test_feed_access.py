"""Who may use the WebSocket of the omlox interface, how much of it, and for how long."""

from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

from dropanchor_service.api.omlox.feed.socket import CONNECTIONS_PER_CLIENT, MAX_SUBSCRIPTIONS
from dropanchor_service.security.api_keys import SOURCE, ApiKeys
from dropanchor_service.security.identity import Authenticator, Scope
from support.omlox import OmloxBench, socket_to
from support.zenoh_router import wait_until


def test_keys_are_read_from_the_handshake_or_from_the_message(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    reader, phone = keys.add("reader", Scope.READ), keys.add_for_tag("phone", "tag-1")
    bench = OmloxBench(authenticator=Authenticator({SOURCE: keys}))
    subscribe = {"event": "subscribe", "topic": "location_updates"}
    with bench.running() as port:
        with socket_to(port) as socket:
            assert socket.ask(**subscribe)["code"] == 10006
            assert socket.ask(**subscribe, params={"token": "wrong"})["code"] == 10006
            assert socket.ask(**subscribe, params={"token": phone})["code"] == 10004
            assert socket.ask(**subscribe, params={"token": reader})["event"] == "subscribed"
        with socket_to(port, secret=reader) as socket:
            socket.subscribe("location_updates")
            bench.poses.move("tag-1")
            assert socket.next()["event"] == "message"


def test_a_revoked_key_ends_its_subscriptions(tmp_path: Path) -> None:
    keys = ApiKeys(tmp_path)
    reader = keys.add("reader", Scope.READ)
    bench = OmloxBench(authenticator=Authenticator({SOURCE: keys}))
    with bench.running() as port, socket_to(port, secret=reader) as socket:
        socket.subscribe("location_updates")
        keys.revoke("reader")
        assert socket.next()["code"] == 10006
        bench.poses.move("tag-1")
        assert socket.ask(event="dance")["code"] == 10000


def test_a_connection_has_a_limit_of_subscriptions_and_a_client_one_of_connections() -> None:
    bench = OmloxBench()
    with bench.running() as port:
        with socket_to(port) as socket:
            for _ in range(MAX_SUBSCRIPTIONS):
                socket.subscribe("proximity_updates")
            assert socket.ask(event="subscribe", topic="proximity_updates")["code"] == 10002
        opened = [socket_to(port) for _ in range(CONNECTIONS_PER_CLIENT)]
        for one in opened:
            one.__enter__().subscribe("proximity_updates")
        with socket_to(port) as socket, pytest.raises(ConnectionClosed) as closed:
            socket.next()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4429
        for one in opened:
            one.__exit__(None, None, None)
        with socket_to(port) as socket:
            wait_until(lambda: socket.ask(event="dance")["code"] == 10000)


def test_without_keys_a_page_of_another_origin_reads_nothing() -> None:
    bench = OmloxBench(cors_origins=("https://map.example",))
    with bench.running() as port:
        with socket_to(port, origin="https://evil.example") as socket, pytest.raises(ConnectionClosed) as closed:
            socket.next()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4403
        for origin in ("https://map.example", f"http://127.0.0.1:{port}"):
            with socket_to(port, origin=origin) as socket:
                socket.subscribe("location_updates")


def test_a_stopping_service_ends_the_connection() -> None:
    bench = OmloxBench()
    with bench.running() as port, socket_to(port) as socket:
        socket.subscribe("location_updates")
        bench.poses.stopping.set()
        with pytest.raises(ConnectionClosed) as closed:
            socket.next()
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1012
