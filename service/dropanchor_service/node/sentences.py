"""What a node says when it cannot pass a request on."""

from dropanchor_schemas.sentences import say
from dropanchor_service.node.owners import Owner

NO_BUCKETS = say("owners_unknown", "This node has not found the owners of the sites yet.")


def without_owner(bucket: str) -> str:
    return say("without_owner", "The sites of {bucket} have no owner now: a standby has to take over.", bucket=bucket)


def without_address(owner: Owner) -> str:
    return say(
        "without_address",
        "{owner} serves {bucket}, but does not say where: set its cluster.address.",
        owner=owner.name,
        bucket=owner.bucket,
    )


def unreachable(owner: Owner) -> str:
    return say(
        "owner_unreachable",
        "{owner}, the owner of {bucket}, cannot be reached. If it is gone, a standby takes over.",
        owner=owner.name,
        bucket=owner.bucket,
    )


def cut_short(owner: Owner) -> str:
    return say(
        "owner_cut_short",
        "{owner}, the owner of {bucket}, ended the connection before it answered.",
        owner=owner.name,
        bucket=owner.bucket,
    )


def silent(owner: Owner) -> str:
    """Return what is said of an owner that answers as a standby does."""
    return say("owner_silent", "{owner} does not serve {bucket} now.", owner=owner.name, bucket=owner.bucket)


def former(owner: Owner) -> str:
    return say("former_owner", "{owner} no longer serves {bucket}.", owner=owner.name, bucket=owner.bucket)


def socket_followed(bucket: str) -> str:
    """Return why a WebSocket ends when its site has a new owner."""
    return say("socket_followed", "{bucket} has another owner now. Connect again.", bucket=bucket)


def socket_unreachable(owner: Owner) -> str:
    """Return why a WebSocket ends when the owner does not answer."""
    return say(
        "socket_unreachable",
        "{owner}, the owner of {bucket}, cannot be reached. Connect again.",
        owner=owner.name,
        bucket=owner.bucket,
    )
