"""A tag is online while anything speaks for it: its token, a WebSocket, or messages over HTTP."""

import numpy as np

from dropanchor_service.store.presence import HTTP_S, Presence


class Clock:
    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def test_messages_over_http_make_a_tag_online_for_a_while() -> None:
    clock = Clock()
    presence = Presence(clock)
    presence.note_http_message("a")
    assert not presence.is_online("a")  # a name that has no row
    presence.add_row("a", 0)
    assert not presence.is_online("a")
    presence.note_http_message("a")
    clock.now_s += HTTP_S - 1
    assert presence.is_online("a")
    presence.note_http_message("a")
    clock.now_s += HTTP_S
    assert not presence.is_online("a")
    assert presence.count() == 0


def test_an_open_websocket_makes_its_tag_online_until_the_last_one_is_closed() -> None:
    presence = Presence(Clock())
    presence.add_row("a", 0)
    with presence.connected("a"), presence.connected("later"):
        with presence.connected("a"):
            presence.note_http_message("a")
        assert presence.is_online("a")
        assert presence.is_online("later")
        presence.add_row("later", 1)
        assert presence.are_online(np.array([0, 1])).tolist() == [True, True]
        assert presence.count() == 2
    assert presence.are_online(np.array([0, 1])).tolist() == [False, False]


def test_a_token_counts_beside_the_other_ways() -> None:
    presence = Presence(Clock())
    presence.set_token("a", True)
    presence.add_row("a", 40)
    with presence.connected("a"):
        presence.set_token("a", False)
        assert presence.is_online("a")
        presence.set_token("a", True)
    assert (presence.is_online("a"), presence.tokens, presence.count()) == (True, 1, 1)
    presence.set_token("a", False)
    assert not presence.is_online("a")
