"""`dropanchor cluster` shows nodes and buckets, and refuses what nobody can do."""

import pytest

from dropanchor_service.cli import main
from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import connect
from dropanchor_service.cluster.head import become_head
from dropanchor_service.cluster.leases import ANY, Claimant
from support.postgresql import needs_postgresql

pytestmark = needs_postgresql


def test_status_move_drain_and_accept_say_what_is(
    url: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dropanchor_service.commands.cluster.MOVE_S", 0.1)
    monkeypatch.setattr("dropanchor_service.commands.cluster.DRAIN_S", 0.1)

    def said(*words: str) -> tuple[int, str]:
        code = main(["cluster", *words, f"--url={url}"])
        shown = capsys.readouterr()
        return code, shown.out + shown.err

    assert said("status") == (0, "there are no buckets yet: no process has been started\n")
    with connect(url, "test") as connection:
        become_head(connection, "head", "10.0.0.1:6379", "sites")
        for name, shards in (("a", 2), ("b", 1)):
            nodes.note(connection, name, shards)
        seen = leases.seen_or_new(connection, "017")
        assert leases.claim(connection, seen, Claimant("a/1", "http://a:1", "", 2.0))
        leases.note_standby(connection, ANY, "a/2", None)
        leases.note_standby(connection, ANY, "b/1", "it is starting")
        text = said("status")[1]
        assert text.splitlines()[:6] == [
            "head: head at 10.0.0.1:6379",
            "node a: 2 shards, 1 with a bucket, 1 standing by",
            "node b: 1 shards, 0 with a bucket, 1 standing by",
            "  b/1 cannot take over: it is starting",
            "017: epoch 1",
            "  owner: a/1 at http://a:1, lease renewed 0.0 s ago",
        ]
        nobody = "no standby on b of 017 can take over: b/1 (cannot take over: it is starting)"
        assert said("move", "017", "--to", "b") == (2, f"dropanchor cluster: {nobody}\n")
        assert said("move", "017", "--to", "c")[1].endswith("can take over: there is none\n")
        assert "no standby took 017 over within 0 s" in said("move", "017")[1]
        assert said("move", "018") == (2, "dropanchor cluster: there is no bucket '018' (known: 017)\n")
        assert said("drain", "c") == (2, "dropanchor cluster: there is no node 'c' (known: a, b)\n")
        assert said("drain", "a")[1].startswith("dropanchor cluster: a still has 017: the head moves them")
        assert "1 standing by, drained\n" in said("status")[1]
        assert said("drain", "a", "--undo") == (0, "a gets buckets again.\n")
        assert said("drain", "b")[0] == 0
        assert said("accept", "017", "018")[0] == 2
        assert said("accept", "017")[0] == 0
        lease = leases.read(connection, "017")
        assert lease is not None
        assert lease.takes_any
