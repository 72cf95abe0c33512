"""What a process in a cluster says to people."""

from dropanchor_schemas.sentences import say
from dropanchor_service.cluster.watch import Lease


def standby_of(lease: Lease) -> str:
    """Return what a standby says that can take over."""
    if not lease.owner:
        return say(
            "standby_without_owner", "This process is a standby of {bucket}, which has no owner.", bucket=lease.bucket
        )
    if lease.address:
        return say(
            "standby_of_owner_at",
            "This process is a standby of {bucket}: the owner is {owner} at {address}, epoch {epoch}.",
            bucket=lease.bucket,
            owner=lease.owner,
            address=lease.address,
            epoch=lease.epoch,
        )
    return say(
        "standby_of_owner",
        "This process is a standby of {bucket}: the owner is {owner}, epoch {epoch}.",
        bucket=lease.bucket,
        owner=lease.owner,
        epoch=lease.epoch,
    )


def unable(lease: Lease, why_not: str) -> str:
    """Return what a standby says that cannot take over."""
    return say(
        "standby_unable",
        "This process is a standby of {bucket} and cannot take over: {why}. To let it, run "
        "dropanchor cluster accept {name}.",
        bucket=lease.bucket,
        why=why_not,
        name=lease.bucket,
    )


def database_away(bucket: str, error: str) -> str:
    """Return what a standby says that does not reach the database."""
    return say(
        "standby_without_database",
        "This process is a standby of {bucket} and cannot reach the database: {error}.",
        bucket=bucket,
        error=error,
    )


def takes_over(bucket: str) -> str:
    return say("takes_over", "This process takes {bucket} over.", bucket=bucket)


def in_doubt(bucket: str) -> str:
    return say("owner_in_doubt", "This process is silent, because another one may own {bucket}.", bucket=bucket)


def gone(bucket: str, why: str) -> str:
    return say("owner_gone", "This process no longer serves {bucket}: {why}.", bucket=bucket, why=why)
