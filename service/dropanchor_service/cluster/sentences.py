"""What a process in a cluster says to people. The page has these sentences in its languages, too."""

from dropanchor_service.cluster.watch import Lease


def standby_of(lease: Lease) -> str:
    """Return what a standby says that can take over."""
    if not lease.owner:
        return f"This process is a standby of {lease.bucket}, which has no owner."
    at = f" at {lease.address}" if lease.address else ""
    return f"This process is a standby of {lease.bucket}: the owner is {lease.owner}{at}, epoch {lease.epoch}."


def unable(lease: Lease, why_not: str) -> str:
    """Return what a standby says that cannot take over."""
    return (
        f"This process is a standby of {lease.bucket} and cannot take over: {why_not}. To let it, run dropanchor "
        f"cluster accept {lease.bucket}."
    )


def database_away(bucket: str, error: str) -> str:
    """Return what a standby says that does not reach the database."""
    return f"This process is a standby of {bucket} and cannot reach the database: {error}."


def takes_over(bucket: str) -> str:
    return f"This process takes {bucket} over."


def in_doubt(bucket: str) -> str:
    return f"This process is silent, because another one may own {bucket}."


def gone(bucket: str, why: str) -> str:
    return f"This process no longer serves {bucket}: {why}."
