"""Who waits for a row is remembered in bounded memory."""

from dropanchor_service.store.pending_tags import PROOF_NS, Newcomers


def test_who_goes_on_sending_has_proven_it() -> None:
    newcomers = Newcomers(most=10)
    heard = [newcomers.hear("a", t_ns) for t_ns in (0, 0, PROOF_NS - 1, PROOF_NS)]
    assert heard == [False, False, False, True]


def test_who_was_heard_least_recently_gives_way_and_its_messages_are_counted() -> None:
    newcomers = Newcomers(most=2)
    for t_ns, name in enumerate("abac"):
        newcomers.hear(name, t_ns)
        assert newcomers.keep(name, (name.encode(), "", t_ns))
    assert [newcomer.name for newcomer in newcomers.all()] == ["c", "a"]
    assert newcomers.take_gone() == 1
    assert newcomers.take_gone() == 0
    assert newcomers.take("a") == [(b"a", "", 0), (b"a", "", 2)]
    assert newcomers.take("a") == []


def test_messages_wait_in_bounded_memory_and_who_goes_makes_room() -> None:
    newcomers = Newcomers(most=3, most_bytes=500)
    for name in "abc":
        newcomers.hear(name, 0)
    assert [newcomers.keep(name, (b"", "", 0)) for name in "abc"] == [True, True, False]
    newcomers.take("a")
    assert newcomers.keep("c", (b"", "", 0))
    assert not newcomers.keep("stranger", (b"", "", 0))
