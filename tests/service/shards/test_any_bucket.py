"""A standby of any bucket takes the first whose lease is free, and none while its node is drained."""

from functools import partial
from importlib.metadata import version
from pathlib import Path
from threading import Thread

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import connect
from dropanchor_service.cluster.leases import Claimant
from dropanchor_service.shards.any_bucket import AnyStandby, AskedToEndError, Owned
from dropanchor_service.shards.starting import Starting
from support.postgresql import needs_postgresql
from support.zenoh_router import wait_until

LEASE_S = 0.5


def standby(
    url: str, name: str, buckets: tuple[str, ...] = ("001", "002", "003"), sites: str = "", lease_s: float = LEASE_S
) -> AnyStandby:
    who = {bucket: Claimant(name, "", sites or bucket, lease_s) for bucket in buckets}
    return AnyStandby(partial(connect, url, name), who, "layout")


@needs_postgresql
def test_each_standby_gets_a_bucket_of_its_own_and_then_those_of_the_dead(url: str) -> None:
    found: list[Owned] = []

    def wait(number: int, lease_s: float) -> None:
        found.append(standby(url, f"a/{number}", lease_s=lease_s).wait())

    for number in range(3):
        Thread(target=wait, args=(number, 3600.0), daemon=True).start()
    wait_until(lambda: len(found) == 3)
    assert {owned.bucket for owned in found} == {"001", "002", "003"}
    assert {owned.claimed.claim.epoch for owned in found} == {1}
    with connect(url, "test") as connection:
        connection.execute("UPDATE dropanchor_lease SET lease_s = %s WHERE bucket = '002'", [LEASE_S])
    Thread(target=wait, args=(3, LEASE_S), daemon=True).start()
    wait_until(lambda: len(found) == 4)  # nobody renews a lease
    assert (found[3].bucket, found[3].claimed.claim.epoch) == ("002", 2)


@needs_postgresql
def test_a_drained_node_and_other_settings_get_nothing_and_say_why(url: str) -> None:
    with connect(url, "test") as connection:
        nodes.set_drained(connection, "a", True)
        for bucket in ("001", "002"):
            seen = leases.seen_or_new(connection, bucket)
            assert leases.claim(connection, seen, Claimant("gone/1", "", bucket, LEASE_S))
        found: dict[str, Owned] = {}

        def wait(name: str, sites: str) -> None:
            found[name] = standby(url, name, ("001", "002"), sites).wait()

        for name, sites in (("a/1", ""), ("b/1", "others")):
            Thread(target=wait, args=(name, sites), daemon=True).start()
        why = "001: its settings of sites and tags are not those of the owner"
        wait_until(lambda: nodes.standbys(connection) == {"a/1": "its node is drained", "b/1": why})
        assert found == {}
        leases.accept_any(connection, "002")
        wait_until(lambda: "b/1" in found)
        assert found["b/1"].bucket == "002"
        nodes.set_drained(connection, "a", False)
        wait_until(lambda: "a/1" in found)


@needs_postgresql
def test_a_process_that_starts_on_a_drained_node_does_not_take_a_free_bucket(url: str) -> None:
    found: list[Owned] = []
    with connect(url, "test") as connection:
        nodes.set_drained(connection, "a", True)
        leases.seen_or_new(connection, "001")
        Thread(target=lambda: found.append(standby(url, "a/1").wait()), daemon=True).start()
        wait_until(lambda: found or nodes.standbys(connection) == {"a/1": "its node is drained"})
        assert found == []
        nodes.set_drained(connection, "a", False)
        wait_until(lambda: found)


@needs_postgresql
def test_a_shard_that_was_asked_to_end_does_so_once_and_no_longer_stands_by(url: str) -> None:
    ended: list[str] = []

    def wait() -> None:
        try:
            standby(url, "a/1", ("001",), "others").wait()
        except AskedToEndError:
            ended.append("a/1")

    with connect(url, "test") as connection:
        seen = leases.seen_or_new(connection, "001")
        assert leases.claim(connection, seen, Claimant("gone/1", "", "sites", LEASE_S))
        for _ in range(2):  # it starts again
            Thread(target=wait, daemon=True).start()
            wait_until(lambda: [shard.name for shard in nodes.waiting(connection)] == ["a/1"])
            assert ended == []
            nodes.ask_to_end(connection, "a/1")
            wait_until(lambda: ended == ["a/1"])
            assert nodes.waiting(connection) == []
            ended.clear()


@needs_postgresql
def test_a_shard_that_cannot_start_says_why_in_its_row(url: str, tmp_path: Path) -> None:
    config = tmp_path / "yards.toml"
    config.write_text(f'cluster.url = "{url}"\ncluster.bucket = "001"\n')
    with connect(url, "test") as connection:

        def said() -> list[str]:
            return [shard.obstacle for shard in nodes.waiting(connection)]

        starting = Starting("a/1", config)
        starting.begin()
        wait_until(lambda: said() == ["it is starting"])
        starting.failed(ImportError("No module\nnamed 'new'"))
        wait_until(lambda: said() == ["it has failed: No module named 'new'"])
        assert nodes.waiting(connection)[0].version == version("dropanchor-service")
        starting.end()
