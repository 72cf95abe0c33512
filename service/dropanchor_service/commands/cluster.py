"""`dropanchor cluster`: show who serves which bucket of sites, and let another process take one over."""

import argparse
import sys
import time
from pathlib import Path

from dropanchor_service.cluster import leases
from dropanchor_service.cluster.database import Connection, DatabaseError, connect, make_tables, sentence_of
from dropanchor_service.cluster.leases import BucketStatus
from dropanchor_service.settings.sources import SettingsError, load_settings

DESCRIPTION = """\
Shows which process owns which bucket of sites, and its standbys; lets a standby take a bucket over while all runs
(`move`), or lets the next owner have other settings of sites or another version (`accept`).
"""
EPILOG = """\
examples:
  dropanchor cluster status --config yard.toml
  dropanchor cluster move yard --url postgresql://dropanchor@db.example/dropanchor
  dropanchor cluster accept yard --config yard.toml     after an update, or after the settings of the sites changed
"""
EXIT_ERROR = 2
MOVE_S = 15.0
POLL_S = 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    status = actions.add_parser("status", help="list the buckets")
    move = actions.add_parser("move", help="let a standby take a bucket over")
    accept = actions.add_parser("accept", help="let the next owner have other settings of sites, or another version")
    for action in (move, accept):
        action.add_argument("bucket", metavar="BUCKET")
    for action in (status, move, accept):
        action.add_argument("--config", type=Path, metavar="FILE", help="settings file (TOML) with cluster.url")
        action.add_argument("--url", metavar="URL", help="PostgreSQL database of the cluster, instead of cluster.url")


def run(arguments: argparse.Namespace) -> int:
    """Run the action. Return 0, or 2 on an error."""
    try:
        with connect(_url_of(arguments), "cluster") as connection:
            make_tables(connection)
            return _run(arguments, connection)
    except (SettingsError, ValueError) as error:
        return _refuse(str(error))
    except DatabaseError as error:
        return _refuse(f"the database does not answer as expected: {sentence_of(error)}")


def _url_of(arguments: argparse.Namespace) -> str:
    options = {} if arguments.url is None else {"cluster": {"url": arguments.url, "bucket": "any"}}
    url = load_settings(arguments.config, options).cluster.url
    if url is None:
        raise ValueError("say which database: --url URL, or --config FILE with cluster.url")
    return url


def _run(arguments: argparse.Namespace, connection: Connection) -> int:
    buckets = leases.status(connection)
    if arguments.action == "status":
        print("\n".join(map(_lines_of, buckets)) or "there are no buckets yet: no process has been started")
        return 0
    found = next((each for each in buckets if each.lease.bucket == arguments.bucket), None)
    if found is None:
        known = ", ".join(each.lease.bucket for each in buckets) or "none"
        return _refuse(f"there is no bucket {arguments.bucket!r} (known: {known})")
    if arguments.action == "accept":
        leases.accept_any(connection, arguments.bucket)
        print(f"The next owner of {arguments.bucket} may have other settings of sites or another version.")
        return 0
    return _move(connection, found)


def _move(connection: Connection, found: BucketStatus) -> int:
    able = [name for name in found.standbys if "cannot take over" not in name]
    if not able and not found.lease.takes_any:
        return _refuse(
            f"no standby of {found.lease.bucket} can take over: {'; '.join(found.standbys) or 'there is none'}"
        )
    leases.set_moving(connection, found.lease.bucket, True)
    end_s = time.monotonic() + MOVE_S
    while time.monotonic() < end_s:
        lease = leases.read(connection, found.lease.bucket)
        if lease is not None and lease.epoch > found.lease.epoch:
            print(f"{lease.bucket} is owned by {lease.owner} now, epoch {lease.epoch}")
            return 0
        time.sleep(POLL_S)
    leases.set_moving(connection, found.lease.bucket, False)
    return _refuse(
        f"no standby took {found.lease.bucket} over within {MOVE_S:.0f} s; `dropanchor cluster status` says why"
    )


def _lines_of(status: BucketStatus) -> str:
    lease = status.lease
    address = f" at {lease.address}" if lease.address else ""
    owner = f"{lease.owner}{address}, lease renewed {lease.age_s:.1f} s ago" if lease.owner else "nobody"
    size = f"{status.checkpoint_bytes / 1e6:.2f} MB, {status.checkpoint_age_s:.1f} s old"
    lines = [
        f"{lease.bucket}: epoch {lease.epoch}",
        f"  owner: {owner}",
        f"  checkpoint: {size if status.checkpoint_bytes else 'none'}",
        f"  standbys: {', '.join(status.standbys) or 'none'}",
    ]
    if lease.takes_any:
        lines.append("  the next owner may have other settings of sites or another version")
    return "\n".join(lines)


def _refuse(text: str) -> int:
    sys.stderr.write(f"dropanchor cluster: {text}\n")
    return EXIT_ERROR
