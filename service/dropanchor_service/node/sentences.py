"""What a node says when it cannot pass a request on. The page has these sentences in its languages, too."""

from dropanchor_service.node.owners import Owner

NO_BUCKETS = "This node has not found the owners of the sites yet."


def without_owner(bucket: str) -> str:
    return f"The sites of {bucket} have no owner now: a standby has to take over."


def without_address(owner: Owner) -> str:
    return f"{owner.name} serves {owner.bucket}, but does not say where: set its cluster.address."


def unreachable(owner: Owner) -> str:
    return f"{owner.name}, the owner of {owner.bucket}, cannot be reached. If it is gone, a standby takes over."


def cut_short(owner: Owner) -> str:
    return f"{owner.name}, the owner of {owner.bucket}, ended the connection before it answered."


def silent(owner: Owner) -> str:
    """Return what is said of an owner that answers as a standby does."""
    return f"{owner.name} does not serve {owner.bucket} now."


def former(owner: Owner) -> str:
    return f"{owner.name} no longer serves {owner.bucket}."


def socket_followed(bucket: str) -> str:
    """Return why a WebSocket ends when its site has a new owner."""
    return f"{bucket} has another owner now. Connect again."


def socket_unreachable(owner: Owner) -> str:
    """Return why a WebSocket ends when the owner does not answer."""
    return f"{owner.name}, the owner of {owner.bucket}, cannot be reached. Connect again."
