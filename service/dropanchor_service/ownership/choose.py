"""Choose between a process that is alone and one in a cluster."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.ownership.alone import Ownership
from dropanchor_service.settings.model import Settings
from dropanchor_service.store import Sites

if TYPE_CHECKING:
    from dropanchor_service.cluster.leases import Claimed


def ownership_of(
    settings: Settings,
    sites: Sites,
    metrics: Metrics,
    on_look: Callable[[], None],
    claimed: "Claimed | None" = None,
) -> Ownership:
    """Return the ownership that the settings want. Raises SettingsError, and ModuleNotFoundError without the extra.

    on_look: called now and then while the process is a standby. claimed: what it has claimed before, if it was one.
    """
    if settings.cluster.url is None:
        return Ownership(settings)
    from dropanchor_service.ownership.in_cluster import ClusterOwnership  # it needs an extra

    return ClusterOwnership(settings, sites, metrics, on_look, claimed)
