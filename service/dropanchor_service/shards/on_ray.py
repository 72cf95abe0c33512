"""What the supervisor needs of Ray. Only this module imports it; it needs the extra `cluster`."""

import logging
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import ray
from ray.util import get_node_ip_address, list_named_actors
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from dropanchor_service.cluster.watch import node_of
from dropanchor_service.shards.actor import ShardActor
from dropanchor_service.shards.placement import Node

__all__ = ["OnRay", "get_node_ip_address"]

NAMESPACE = "dropanchor"
RESOURCE = "shard"

_log = logging.getLogger(__name__)


def address_of_this_machine() -> str:
    """Return the address that other machines probably reach."""
    return str(get_node_ip_address())


class _Alive(NamedTuple):
    """A node of Ray. number: what Ray calls it, another one after each start."""

    number: str
    shards: int


class OnRay:
    """Nodes and shards of one cluster of Ray, while this is open."""

    def __init__(self, head: str, node_address: str) -> None:
        """head: its address and port. node_address: of this machine. Raises ConnectionError."""
        quiet: Any = {"log_to_driver": False, "logging_level": logging.ERROR}
        ray.init(head, namespace=NAMESPACE, _node_ip_address=node_address, **quiet)
        self._nodes: Mapping[str, _Alive] = {}

    def __enter__(self) -> "OnRay":
        return self

    def __exit__(self, *_: object) -> None:
        ray.shutdown()

    def nodes(self) -> list[Node]:
        """Return the nodes that are alive and carry shards. Of two with one name, the first counts."""
        found: dict[str, _Alive] = {}
        rows: list[dict[str, Any]] = ray.nodes()
        for row in rows:
            name, shards = row["NodeName"], int(row["Resources"].get(RESOURCE, 0))
            if row["Alive"] and shards:
                if name in found:
                    _log.error("two nodes have the name %s: give one another with cluster.name", name)
                found.setdefault(name, _Alive(row["NodeID"], shards))
        self._nodes = found
        return [Node(name, alive.shards) for name, alive in found.items()]

    def shards(self) -> list[str]:
        """Return the names of the shards that run, or that Ray starts again, on the nodes that `nodes` found."""
        return [name for full in list_named_actors() if (name := full.partition(" ")[0]) and full == self._full(name)]

    def start(self, name: str) -> None:
        """Start a shard on its node.

        It takes nothing of the resource that counts the shards of a node. If the head dies while Ray makes the process
        of a shard, nobody gives back what the process would have taken, and a shard in its place would wait for ever.
        """
        alive = self._nodes[node_of(name)]
        actor: Any = ray.remote(ShardActor)
        actor.options(
            name=self._full(name),
            num_cpus=0,
            max_restarts=-1,
            lifetime="detached",
            get_if_exists=True,
            scheduling_strategy=NodeAffinitySchedulingStrategy(alive.number, soft=False),
        ).remote(name)

    def kill(self, name: str) -> None:
        """End a shard for good, so that its name is free for another one.

        Ray could not restart one whose process it has never made.
        """
        with suppress(ValueError):  # it is gone already
            ray.kill(ray.get_actor(self._full(name)), no_restart=True)

    def _full(self, name: str) -> str:
        """Return the name of an actor. After a restart of its node, the shard is another actor."""
        alive = self._nodes.get(node_of(name))
        return f"{name} {'' if alive is None else alive.number}"
