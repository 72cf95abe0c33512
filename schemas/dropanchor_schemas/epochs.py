"""Drop poses of processes that no longer serve a site. This module needs only the standard library."""


class EpochFence:
    """Remembers the highest epoch that was seen of each site, or of each tag. Not thread-safe.

    When one process of a cluster takes a site over from another one, the former may have poses on their way, or wake up
    much later and send some. These have a lower epoch.
    """

    def __init__(self) -> None:
        self._highest: dict[str, int] = {}

    def accepts(self, key: str, epoch: int) -> bool:
        """Return whether a pose with this epoch is of the newest known owner. key: the site, or the tag."""
        if epoch < self._highest.get(key, 0):
            return False
        self._highest[key] = epoch
        return True
