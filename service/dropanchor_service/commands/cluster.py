"""`dropanchor cluster`: run sites on several machines, show who serves what, and move it."""

import argparse
import time

from dropanchor_service.cluster import leases, nodes
from dropanchor_service.cluster.database import Connection, DatabaseError, connect, make_tables, sentence_of
from dropanchor_service.cluster.leases import BucketStatus
from dropanchor_service.cluster.watch import node_of
from dropanchor_service.commands import cluster_start, cluster_upgrade
from dropanchor_service.commands.cluster_move import moved
from dropanchor_service.commands.cluster_options import add_database_options, refuse, url_of
from dropanchor_service.commands.cluster_status import status_text
from dropanchor_service.commands.cluster_upgrade import upgrade
from dropanchor_service.settings.sources import SettingsError

DESCRIPTION = """\
Runs sites on several machines: `start` makes this machine a node, `stop` ends that, `drain` moves all buckets off a
node. `status` shows which process owns which bucket, and who stands by; `move` lets another take a bucket over while
all runs; `upgrade` lets all shards run a new version, one by one; `accept` lets the next owner have other settings of
sites or another version.
"""
EPILOG = """\
examples:
  dropanchor cluster start --head --config yards.toml                 on the machine that looks after the others
  dropanchor cluster start --join --config yards.toml                 on each of the others
  dropanchor cluster stop --config yards.toml                         on a machine that is to leave
  dropanchor cluster supervise --ray 10.0.0.1:6379 --address 10.0.0.1 --token token --config yards.toml
  dropanchor cluster status --config yards.toml
  dropanchor cluster move 017 --to machine-2 --config yards.toml
  dropanchor cluster drain machine-1 --config yards.toml              before you service it
  dropanchor cluster upgrade --config yards.toml                      after a new version was installed everywhere
  dropanchor cluster accept 017 018 --config yards.toml               after the settings of the sites changed
"""
MOVE_S = 15.0
DRAIN_S = 120.0
POLL_S = 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    cluster_start.add_actions(actions)
    status = actions.add_parser("status", help="list nodes and buckets")
    drain = actions.add_parser("drain", help="move all buckets off a node, until it starts again")
    drain.add_argument("node", metavar="NODE")
    drain.add_argument("--undo", action="store_true", help="give it buckets again")
    move = actions.add_parser("move", help="let a standby take a bucket over")
    move.add_argument("bucket", metavar="BUCKET")
    move.add_argument("--to", default="", metavar="NODE", help="the node that takes it over (default: any)")
    accept = actions.add_parser("accept", help="let the next owner have other settings of sites, or another version")
    accept.add_argument("buckets", nargs="+", metavar="BUCKET")
    upgrade = actions.add_parser("upgrade", help="let all shards run the version that was installed, one by one")
    cluster_upgrade.add_arguments(upgrade)
    for action in (status, drain, move, accept, upgrade):
        add_database_options(action)
        action.set_defaults(act=_with_database)


def run(arguments: argparse.Namespace) -> int:
    """Run the action. Return 0, 1 if a node died, 2 on an error, or 75 if another head has taken over."""
    try:
        return int(arguments.act(arguments))
    except KeyboardInterrupt:
        return 0
    except (SettingsError, ValueError) as error:
        return refuse(str(error))
    except DatabaseError as error:
        return refuse(f"the database does not answer as expected: {sentence_of(error)}")


def _with_database(arguments: argparse.Namespace) -> int:
    actions = {"status": _status, "drain": _drain, "move": _move, "accept": _accept, "upgrade": upgrade}
    with connect(url_of(arguments), "cluster") as connection:
        make_tables(connection)
        return actions[arguments.action](arguments, connection)


def _status(_: argparse.Namespace, connection: Connection) -> int:
    print(status_text(connection))
    return 0


def _found(connection: Connection, bucket: str) -> BucketStatus:
    """Return the status of a bucket. Raises ValueError if there is none of this name."""
    buckets = leases.status(connection)
    for each in buckets:
        if each.lease.bucket == bucket:
            return each
    known = ", ".join(each.lease.bucket for each in buckets) or "none"
    raise ValueError(f"there is no bucket {bucket!r} (known: {known})")


def _accept(arguments: argparse.Namespace, connection: Connection) -> int:
    for bucket in [_found(connection, each).lease.bucket for each in arguments.buckets]:
        leases.accept_any(connection, bucket)
        print(f"The next owner of {bucket} may have other settings of sites or another version.")
    return 0


def _move(arguments: argparse.Namespace, connection: Connection) -> int:
    found = _found(connection, arguments.bucket)
    bucket, to = found.lease.bucket, arguments.to
    standbys = _standbys_on(to, connection, found)
    able = [name for name, why_not in standbys.items() if not why_not]
    if not able and not (standbys and found.lease.takes_any):
        said = "; ".join(f"{name} (cannot take over: {why_not})" for name, why_not in standbys.items())
        return refuse(f"no standby{f' on {to}' if to else ''} of {bucket} can take over: {said or 'there is none'}")
    lease = moved(connection, found.lease, to, MOVE_S)
    if lease is None:
        return refuse(f"no standby took {bucket} over within {MOVE_S:.0f} s; `dropanchor cluster status` says why")
    print(f"{bucket} is owned by {lease.owner} now, epoch {lease.epoch}")
    return 0


def _standbys_on(node: str, connection: Connection, found: BucketStatus) -> dict[str, str]:
    """Return who stands by for a bucket on a node, or on any, each with its obstacle."""
    own = (name.partition(" (cannot take over: ") for name in found.standbys)
    every = {name: why_not.removesuffix(")") for name, _, why_not in own} | nodes.standbys(connection)
    return {name: why_not for name, why_not in every.items() if node in ("", node_of(name))}


def _drain(arguments: argparse.Namespace, connection: Connection) -> int:
    name = arguments.node
    known = [node.name for node in nodes.read(connection)]
    if name not in known:
        return refuse(f"there is no node {name!r} (known: {', '.join(known) or 'none'})")
    nodes.set_drained(connection, name, not arguments.undo)
    if arguments.undo:
        print(f"{name} gets buckets again.")
        return 0
    left: list[str] = []
    end_s = time.monotonic() + DRAIN_S
    while time.monotonic() < end_s:
        left = leases.owned_by_node(connection, name)
        if not left:
            print(f"{name} has no buckets, and gets none until it starts again.")
            return 0
        time.sleep(POLL_S)
    return refuse(
        f"{name} still has {', '.join(left)}: the head moves them one after another, if one runs and if other "
        "nodes have shards that stand by; `dropanchor cluster status` shows that"
    )
