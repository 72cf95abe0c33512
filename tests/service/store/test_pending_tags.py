"""Who waits for a row is remembered in bounded memory."""

from dropanchor_service.store.pending_tags import CONFIRMED_NS, PendingTags


def test_who_goes_on_sending_has_proven_it() -> None:
    pending_tags = PendingTags(most=10)
    heard = [pending_tags.hear("a", t_ns) for t_ns in (0, 0, CONFIRMED_NS - 1, CONFIRMED_NS)]
    assert heard == [False, False, False, True]


def test_who_was_heard_least_recently_gives_way_and_its_messages_are_counted() -> None:
    pending_tags = PendingTags(most=2)
    for t_ns, name in enumerate("abac"):
        pending_tags.hear(name, t_ns)
        assert pending_tags.keep(name, (name.encode(), "", t_ns))
    assert [pending.name for pending in pending_tags.all()] == ["c", "a"]
    assert pending_tags.take_gone() == 1
    assert pending_tags.take_gone() == 0
    assert pending_tags.take("a") == [(b"a", "", 0), (b"a", "", 2)]
    assert pending_tags.take("a") == []


def test_messages_wait_in_bounded_memory_and_who_goes_makes_room() -> None:
    pending_tags = PendingTags(most=3, most_bytes=500)
    for name in "abc":
        pending_tags.hear(name, 0)
    assert [pending_tags.keep(name, (b"", "", 0)) for name in "abc"] == [True, True, False]
    pending_tags.take("a")
    assert pending_tags.keep("c", (b"", "", 0))
    assert not pending_tags.keep("stranger", (b"", "", 0))
