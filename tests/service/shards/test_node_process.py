"""A head claims its lease once Ray runs, and a node waits for a head that starts."""

import logging
from functools import partial

import pytest

from dropanchor_service.cluster import leases
from dropanchor_service.cluster.database import connect
from dropanchor_service.cluster.head import HeadError, become_head, free_lease, head_to_join
from dropanchor_service.cluster.leases import HEAD
from dropanchor_service.shards import node_process
from support.cluster import needs_ray
from support.postgresql import needs_postgresql
from support.zenoh_router import free_port

pytestmark = [needs_ray, needs_postgresql]


def test_a_head_without_ray_does_not_claim_the_lease(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node_process, "START_S", 0.0)
    with pytest.raises(HeadError, match="Ray does not answer"):
        node_process.supervise("head", f"127.0.0.1:{free_port()}", "127.0.0.1", partial(connect, url, "head"), "sites")
    with connect(url, "test") as connection:
        lease = leases.read(connection, HEAD)
        assert lease is not None
        assert (lease.owner, lease.epoch) == ("", 0)


def test_a_node_waits_for_a_head_that_starts(
    url: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with connect(url, "test") as connection:

        def start_head(_: float) -> None:
            become_head(connection, free_lease(connection), "head", "10.0.0.1:6379", "sites")

        monkeypatch.setattr("dropanchor_service.cluster.head.time.sleep", start_head)
        with caplog.at_level(logging.INFO):
            assert head_to_join(connection, "sites", limit_s=60.0).address == "10.0.0.1:6379"
        assert caplog.messages == ["no head runs yet: waiting for it"]
        leases.release(connection, HEAD, 1)
        with pytest.raises(HeadError, match="no head runs: start one"):
            head_to_join(connection, "sites", limit_s=-1.0)
