"""Drop poses of processes that no longer serve a site. This module needs only the standard library."""


class EpochFence:
    """Remembers the highest epoch that was seen of each site. Not thread-safe.

    When one process of a cluster takes a site over from another one, the former may have poses on their way, or wake up
    much later and send some. These have a lower epoch.
    """

    def __init__(self) -> None:
        self._highest: dict[str, int] = {}

    def accepts(self, site: str, epoch: int) -> bool:
        """Return whether a pose with this epoch is of the newest owner of the site that is known here."""
        if epoch < self._highest.get(site, 0):
            return False
        self._highest[site] = epoch
        return True
