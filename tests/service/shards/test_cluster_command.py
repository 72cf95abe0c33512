"""`dropanchor cluster` shows nodes and buckets, and refuses what nobody can do."""

import re

import pytest

from dropanchor_service.cli import main
from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import connect
from dropanchor_service.cluster.head import become_head, free_lease
from dropanchor_service.cluster.leases import ANY, Claimant
from dropanchor_service.commands.cluster_upgrade import seen_in
from support.postgresql import needs_postgresql

pytestmark = needs_postgresql
LASTING = """
UPDATE dropanchor_lease SET renewed = clock_timestamp() + interval '1 h';
UPDATE dropanchor_node SET seen = clock_timestamp() + interval '1 h';
UPDATE dropanchor_standby SET seen = clock_timestamp() + interval '1 h';
"""
"""What was there stays there, however slow the test is."""


def test_status_move_drain_and_accept_say_what_is(
    url: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dropanchor_service.commands.cluster.MOVE_S", 0.1)
    monkeypatch.setattr("dropanchor_service.commands.cluster.DRAIN_S", 0.1)
    monkeypatch.setattr("dropanchor_service.cluster.head.version", lambda _: "0.2.0")

    def said(*words: str) -> tuple[int, str]:
        code = main(["cluster", *words, f"--url={url}"])
        shown = capsys.readouterr()
        return code, shown.out + shown.err

    assert said("status") == (0, "there are no buckets yet: no process has been started\n")
    with connect(url, "test") as connection:
        become_head(connection, free_lease(connection), "head", "10.0.0.1:6379", "sites")
        for name, shards in (("a", 2), ("b", 1)):
            nodes.note(connection, name, shards)
        seen = leases.seen_or_new(connection, "017")
        assert leases.claim(connection, seen, Claimant("a/1", "http://a:1", "", 2.0, "0.1.0"))
        leases.note_standby(connection, ANY, "a/2", None, "0.2.0", "0.2.0")
        leases.note_standby(connection, ANY, "b/1", "it is starting", "0.1.0", "0.2.0")
        text = said("status")[1]
        assert re.sub(r"[\d.]+ s ago", "lately", text).splitlines()[:6] == [
            "head: head at 10.0.0.1:6379, version 0.2.0",
            "node a: 2 shards, 1 with a bucket, 1 standing by, version a/1 0.1.0, a/2 0.2.0",
            "node b: 1 shards, 0 with a bucket, 1 standing by, version 0.1.0, 0.2.0 is installed",
            "  b/1 cannot take over: it is starting",
            "017: epoch 1",
            "  owner: a/1 at http://a:1, version 0.1.0, lease renewed lately",
        ]
        nobody = "no standby on b of 017 can take over: b/1 (cannot take over: it is starting)"
        assert said("move", "017", "--to", "b") == (2, f"dropanchor cluster: {nobody}\n")
        assert said("move", "017", "--to", "c")[1].endswith("can take over: there is none\n")
        assert "no standby took 017 over within 0 s" in said("move", "017")[1]
        assert said("move", "018") == (2, "dropanchor cluster: there is no bucket '018' (known: 017)\n")
        assert said("drain", "c") == (2, "dropanchor cluster: there is no node 'c' (known: a, b)\n")
        assert said("drain", "a")[1].startswith("dropanchor cluster: a still has 017: the head moves them")
        assert "1 standing by, drained, version a/1" in said("status")[1]
        assert said("drain", "a", "--undo") == (0, "a gets buckets again.\n")
        assert said("drain", "b")[0] == 0
        assert said("accept", "017", "018")[0] == 2
        assert said("accept", "017")[0] == 0
        lease = leases.read(connection, "017")
        assert lease is not None
        assert lease.takes_any


def test_upgrade_says_what_hinders_it_and_changes_nothing(
    url: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dropanchor_service.commands.cluster_upgrade.installed", lambda: "0.2.0")
    monkeypatch.setattr("dropanchor_service.commands.cluster_upgrade.WAIT_S", 0.1)
    monkeypatch.setattr("dropanchor_service.commands.cluster_upgrade.MOVE_S", 0.1)
    monkeypatch.setattr("dropanchor_service.cluster.head.version", lambda _: "0.2.0")

    def said(*words: str) -> tuple[int, str]:
        connection.execute(LASTING)
        code = main(["cluster", "upgrade", *words, f"--url={url}"])
        shown = capsys.readouterr()
        return code, shown.out + shown.err

    with connect(url, "test") as connection:
        assert "no head sees a node" in said()[1]
        become_head(connection, free_lease(connection), "head", "10.0.0.1:6379", "sites")
        nodes.note(connection, "a", 2)
        seen = leases.seen_or_new(connection, "017")
        assert leases.claim(connection, seen, Claimant("a/1", "http://a:1", "", 60.0, "0.1.0"))
        leases.note_standby(connection, ANY, "a/2", None, "0.1.0", "0.1.0")
        code, text = said()
        assert code == 2
        assert "the upgrade cannot begin:\n  the node a has 0.1.0: install 0.2.0 there" in text
        leases.note_standby(connection, ANY, "a/2", None, "0.1.0", "0.2.0")
        assert said("--check") == (0, "2 of 2 shards are not 0.2.0 yet, and nothing hinders an upgrade.\n")
        assert not nodes.has_to_end(connection, "a/2")
        code, text = said()  # nobody is there who could end
        assert (code, text.splitlines()[:2]) == (
            2,
            ["a/2: 0.1.0 -> 0.2.0", "dropanchor cluster: a/2 does not end: see its log, and end its process."],
        )
        assert text.endswith("Then run `dropanchor cluster upgrade` again: it goes on from there.\n")
        assert not nodes.has_to_end(connection, "a/2")
        leases.note_standby(connection, ANY, "a/2", None, "0.2.0", "0.2.0")
        assert "no shard on a took 017 over within 0 s" in said()[1]
        assert seen_in(connection).leases["017"].is_moving is False
