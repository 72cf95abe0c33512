"""Measure what a client of all sites waits for: 12 services behind an API node, beside one with as many tags."""

import statistics
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx
import pytest

from benchmarks import proc, report
from benchmarks.programs import Program, running
from dropanchor_service.cluster.database import connect, make_tables
from support.api_nodes import SECRET
from support.postgresql import needs_postgresql, running_postgresql
from support.service import Running, running_service

pytestmark = [pytest.mark.benchmark, needs_postgresql]

SHARDS, ROUNDS, SINGLE = 12, 15, 100
SHAPES = [(1, 834), (84, 10)]  # sites of each shard, tags of each site
POSES, SITES, ONE = "/api/v1/sites/poses", "/api/v1/sites", "/api/v1/sites/000.site-0/tags/tag-0/pose"
LIMIT_MS = 100.0  # on a machine that does nothing else
MANY_SITES = 1.5  # times what one service needs: with many sites in a service, writing their poses takes the time
_LEASE = "INSERT INTO dropanchor_lease (bucket, epoch, owner, address) VALUES (%s, 1, %s, %s)"


def address_of(program: Program) -> str:
    return f"http://127.0.0.1:{program.request('port').strip()}"


@contextmanager
def node_before_shards(folder: Path, sites: int, tags: int) -> Iterator[tuple[Running, str]]:
    """Run the services and a node. Yield it, and the address of the first service."""
    secret = folder / f"node-{sites}.secret"
    secret.write_bytes(SECRET)
    with ExitStack() as opened:
        database = opened.enter_context(running_postgresql())
        url = database.new_database()
        shards = [f"{index:03}" for index in range(SHARDS)]
        programs = [opened.enter_context(running("shard", bucket, sites, tags)) for bucket in shards]
        for program in programs:
            httpx.get(f"{address_of(program)}{POSES}", timeout=120.0, trust_env=False).raise_for_status()  # the first
        with connect(url, "benchmark") as connection:
            make_tables(connection)
            for bucket, program in zip(shards, programs, strict=True):
                connection.execute(_LEASE, [bucket, bucket, address_of(program)])
        options = ("--url", url, "--node-secret", str(secret))
        yield (
            opened.enter_context(running_service(*options, subcommand="api")),
            address_of(programs[0]),
        )


def milliseconds(client: httpx.Client, address: str, path: str, times: int = 1) -> float:
    began_s = time.monotonic()
    for _ in range(times):
        client.get(f"{address}{path}").raise_for_status()
    return (time.monotonic() - began_s) / times * 1e3


def test_all_sites_through_a_node_before_twelve_services_beside_one_service(tmp_path: Path) -> None:
    lines, worst_ms = [], 0.0
    for sites, tags in SHAPES:
        with (
            running("shard", "000", SHARDS * sites, tags) as whole,
            node_before_shards(tmp_path, sites, tags) as (node, first),
            httpx.Client(timeout=30.0, trust_env=False) as client,
        ):
            one = address_of(whole)
            client.get(f"{one}{POSES}", timeout=120.0)
            found = {address: len(client.get(f"{address}{POSES}").content) for address in (one, node.url)}
            taken: dict[tuple[str, str], list[float]] = {}
            for _ in range(ROUNDS):
                for path in (POSES, SITES):
                    for name, address in (("one", one), ("node", node.url)):
                        taken.setdefault((name, path), []).append(milliseconds(client, address, path))
            cpu_s = proc.cpu_s(node.process.pid)
            single = {name: milliseconds(client, at, ONE, SINGLE) for name, at in (("one", first), ("node", node.url))}
            cpu_ms = (proc.cpu_s(node.process.pid) - cpu_s) / SINGLE * 1e3
            resident_mb = proc.resident_bytes(node.process.pid) / 1e6
        median = {key: statistics.median(values) for key, values in taken.items()}
        worst_ms = max(
            worst_ms, min(median["node", POSES], median["node", SITES]) if sites > 1 else median["node", POSES]
        )
        assert abs(found[one] - found[node.url]) < 0.02 * found[one]
        lines.append(
            f"| {SHARDS} × {sites} × {tags} | {found[node.url] / 1e6:.1f} | {median['one', POSES]:.0f} | "
            f"{median['node', POSES]:.0f} | {median['one', SITES]:.0f} | {median['node', SITES]:.0f} | "
            f"{single['one']:.1f} | {single['node']:.1f} | {cpu_ms:.1f} | {resident_mb:.0f} |"
        )
    names = (
        "services × sites × tags | MB of poses | all poses: one service | node | all sites: one service | node | "
        "one pose: its service | node | node CPU ms for it | node MB"
    )
    head = [f"| {names} |", "|---" * 10 + "|"]
    report.record("nodes", "\n".join([*head, *lines, "", "Medians in ms from request to the last byte, on loopback."]))
    assert worst_ms <= LIMIT_MS
