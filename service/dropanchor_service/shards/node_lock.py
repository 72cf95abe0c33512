"""One node for each folder: the lock that its process holds."""

from pathlib import Path

from dropanchor_tag_client.folder_lock import FolderInUseError, FolderLock, Owner

FILE = "node.lock"


def node_lock(folder: Path) -> FolderLock:
    """Return the lock of the folder of a node, which is made. Raises ValueError while another process holds it."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        return FolderLock(folder, FILE)
    except FolderInUseError as error:
        raise ValueError(f"a node runs already: {error}; stop it, or use another folder") from error


def running_node(folder: Path) -> Owner | None:
    """Return the process that runs a node with this folder, None if none does."""
    return FolderLock.holder(folder, FILE)
