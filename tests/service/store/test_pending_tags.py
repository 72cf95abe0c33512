"""Tags without a row are remembered, with their messages, in bounded memory."""

from dropanchor_service.store.pending_tags import CONFIRMED_NS, PendingTags


def test_a_tag_that_keeps_sending_is_confirmed() -> None:
    pending_tags = PendingTags(limit=10)
    confirmed = [pending_tags.on_message("a", t_ns) for t_ns in (0, 0, CONFIRMED_NS - 1, CONFIRMED_NS)]
    assert confirmed == [False, False, False, True]


def test_the_least_recent_tag_is_evicted_and_its_messages_are_counted() -> None:
    pending_tags = PendingTags(limit=2)
    for t_ns, name in enumerate("abac"):
        pending_tags.on_message(name, t_ns)
        assert pending_tags.buffer(name, (name.encode(), "", t_ns))
    assert [pending.name for pending in pending_tags.all()] == ["c", "a"]
    assert pending_tags.take_evicted() == 1
    assert pending_tags.take_evicted() == 0
    assert pending_tags.take("a") == [(b"a", "", 0), (b"a", "", 2)]
    assert pending_tags.take("a") == []


def test_messages_are_buffered_in_bounded_memory_and_a_tag_that_is_taken_makes_room() -> None:
    pending_tags = PendingTags(limit=3, max_bytes=500)
    for name in "abc":
        pending_tags.on_message(name, 0)
    assert [pending_tags.buffer(name, (b"", "", 0)) for name in "abc"] == [True, True, False]
    pending_tags.take("a")
    assert pending_tags.buffer("c", (b"", "", 0))
    assert not pending_tags.buffer("unknown", (b"", "", 0))
