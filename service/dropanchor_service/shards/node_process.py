"""The process of a node: it starts Ray, is the supervisor if it is the head, and leaves in good order."""

import logging
import os
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import Connection, DatabaseError, make_tables
from dropanchor_service.cluster.head import HeadError, become_head, free_lease, head_to_join
from dropanchor_service.cluster.watch import Lease, node_of
from dropanchor_service.runtime.signals import interrupts
from dropanchor_service.runtime.systemd import Systemd
from dropanchor_service.shards.on_ray import OnRay
from dropanchor_service.shards.ray_node import RayNode, stop_ray
from dropanchor_service.shards.supervisor import Supervisor

EXIT_DIED = 1
EXIT_GONE = 75
START_S = 60.0  # for Ray, and for a head that a node waits for
LEAVE_S = 60.0  # for its buckets to move, two to three seconds each
POLL_S = 0.2

Connect = Callable[[], Connection]
"""Raises DatabaseError."""

_log = logging.getLogger(__name__)


class Head(NamedTuple):
    """Who is to be the head. name: of its node. ray: address and port of Ray. address: of this machine. free: the lease
    to claim once Ray runs. sites: digest of the settings of all sites."""

    name: str
    ray: str
    address: str
    free: Lease
    sites: str


def run_node(node: RayNode, connect: Connect, sites: str) -> int:
    """Run a node. Return 0 after a signal, 1 if Ray died, 75 if another head has taken over. Raises HeadError.

    sites: digest of the settings of all sites.
    """
    head, at = _agreed(node, connect, sites)
    with interrupts() as interrupt:
        ray = node.started(at, os.environ)
        try:
            if head is not None:
                with interrupt.raising():
                    return _be_head(head, connect, lambda: ray.poll() is None)
            _log.info("%s joins the cluster at %s, with %d shards", node.name, at, node.shards)
            Systemd().ready()
            if not interrupt.wait(lambda: ray.poll() is None):
                _log.error("Ray has ended: %s", node.last_words())
                return EXIT_DIED
            _leave(node.name, connect, lambda: True)
            return 0
        finally:
            stop_ray(ray)


def supervise(name: str, ray: str, address: str, connect: Connect, sites: str) -> int:
    """Be the head of nodes that something else starts; see `run_node`. ray: its address and port."""
    with connect() as connection:
        make_tables(connection)
        head = Head(name, ray, address, free_lease(connection), sites)
    with interrupts() as interrupt, interrupt.raising():
        return _be_head(head, connect, lambda: True)


def _agreed(node: RayNode, connect: Connect, sites: str) -> tuple[Head | None, str]:
    """Return the head, if this node is it, and its address. Raises HeadError."""
    with connect() as connection:
        make_tables(connection)
        if node.head is None:
            at = f"{node.address}:{node.port}"
            head = Head(node.name, at, node.address, free_lease(connection), sites)
        else:
            found = head_to_join(connection, sites, START_S)
            head, at = None, node.head or found.address
        if node.shards:
            nodes.set_drained(connection, node.name, False)
    return head, at


def _be_head(head: Head, connect: Connect, is_alive: Callable[[], bool]) -> int:
    with _connected(head, is_alive) as on_ray, interrupts() as interrupt:
        with connect() as connection:
            epoch = become_head(connection, head.free, head.name, head.ray, head.sites)
        supervisor = Supervisor(on_ray, connect, epoch)

        def turn() -> bool:
            if is_alive():
                supervisor.turn(time.monotonic())
            return supervisor.is_head and is_alive()

        _log.info("%s is the head; other machines join it at %s", head.name, head.ray)
        Systemd().ready()
        stopped = interrupt.wait(turn)
        if stopped:
            _leave(head.name, connect, turn)
            supervisor.give_back()
        supervisor.close()
    if not supervisor.is_head:
        _log.error("another process is the head now")
        return EXIT_GONE
    return 0 if stopped else EXIT_DIED


def _connected(head: Head, is_alive: Callable[[], bool]) -> OnRay:
    """Return the connection to Ray, which may be starting. Raises HeadError."""
    end_s = time.monotonic() + START_S
    while not _listens(head.ray):
        if not is_alive() or time.monotonic() > end_s:
            raise HeadError(f"Ray does not answer at {head.ray}; its messages are in ray.log")
        time.sleep(POLL_S)
    try:
        return OnRay(head.ray, head.address)
    except Exception as error:  # Ray has many
        raise HeadError(f"Ray does not answer at {head.ray}: {error}") from error


def _listens(address: str) -> bool:
    """Return whether somebody listens there. Ray itself would try for most of a minute."""
    host, _, port = address.rpartition(":")
    with suppress(OSError), socket.create_connection((host, int(port)), timeout=1.0):
        return True
    return False


def _leave(name: str, connect: Connect, turn: Callable[[], bool]) -> None:
    """Let the head move all buckets off this node, as long as there is where to."""
    end_s = time.monotonic() + LEAVE_S
    with suppress(DatabaseError, HeadError), connect() as connection:
        nodes.set_drained(connection, name, True)
        while (left := leases.owned_by_node(connection, name)) and time.monotonic() < end_s:
            others = [shard for shard, why in nodes.standbys(connection).items() if node_of(shard) != name and not why]
            if not others or not leases.has_head(connection):
                _log.warning("nobody takes over %s", ", ".join(left))
                return
            turn()
            time.sleep(POLL_S)
